"""Fill parameters ``${name}`` into the text of lattice files; ``$${`` gives a plain ``${``."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping

from ffdcli.batch.spec import Value
from ffdcli.errors import LatticeError
from ffdcli.lattice.file.source import MAX_BYTES

_FIELD = re.compile(r"\$?\$\{([^}\n]*)\}")


def fill(text: str, values: Mapping[str, Value], file: str) -> tuple[str, list[str]]:
    """Replace each ``${name}`` by its value.

    The number of lines stays the same, so that later errors state the right line.

    Returns
    -------
    str
        The filled text: numbers with all digits, booleans and lists in YAML, strings unquoted.
    list of str
        Names of the values that the text does not use.

    Raises
    ------
    LatticeError
        The text uses a name without a value, with the line; or the filled text is too long.
    """
    used = set()

    def replaced(match: re.Match[str]) -> str:
        if match.group().startswith("$$"):
            return match.group()[1:]
        name = match.group(1).strip()
        if name not in values:
            known = ", ".join(values)
            raise LatticeError(
                f"there is no value for ${{{name}}}",
                file=file,
                line=text.count("\n", 0, match.start()) + 1,
                hint=f"the parameters of the job are {known}"
                if known
                else "add `parameters` to the job",
            )
        used.add(name)
        return texts[name]

    texts = {name: value_text(value) for name, value in values.items()}
    size = len(text) + sum(len(texts.get(m[1].strip(), "")) for m in _FIELD.finditer(text))
    if size > MAX_BYTES:
        raise LatticeError(
            f"with the parameters of the job the lattice file has {size:,} characters; "
            f"{MAX_BYTES:,} are allowed",
            file=file,
            hint="put long lists into .csv or .npy files",
        )
    filled = _FIELD.sub(replaced, text)
    return filled, [name for name in values if name not in used]


def value_text(value: Value) -> str:
    """A value as YAML, strings unquoted."""
    return value if isinstance(value, str) else json.dumps(value)
