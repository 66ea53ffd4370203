"""Fill parameters ``${name}`` into the text of lattice files; ``$${`` gives a plain ``${``."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping

from ffdcli.batch.spec import Value
from ffdcli.errors import LatticeError

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
        The text uses a name without a value; the error states the line.
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
        return value_text(values[name])

    filled = _FIELD.sub(replaced, text)
    return filled, [name for name in values if name not in used]


def value_text(value: Value) -> str:
    """A value as YAML, strings unquoted."""
    return value if isinstance(value, str) else json.dumps(value)
