"""Parameters in the text of lattice files: ``${name}``; ``$${`` stands for ``${`` itself."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping

from ffdcli.batch.spec import Value
from ffdcli.errors import LatticeError

_FIELD = re.compile(r"\$?\$\{([^}\n]*)\}")


def fill(text: str, values: Mapping[str, Value], file: str) -> tuple[str, list[str]]:
    """Put values in place of ``${name}``.

    Lines stay where they are, so that later errors name the right one.

    Returns
    -------
    str
        The text with numbers in full, booleans and lists as YAML writes them, text as it is.
    list of str
        Names of the values that the text does not ask for.

    Raises
    ------
    LatticeError
        The text asks for a value that is not given; names the line.
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
                hint=f"the job's parameters are {known}" if known else "give the job parameters",
            )
        used.add(name)
        return value_text(values[name])

    filled = _FIELD.sub(replaced, text)
    return filled, [name for name in values if name not in used]


def value_text(value: Value) -> str:
    """A value as YAML text, without quotes."""
    return value if isinstance(value, str) else json.dumps(value)
