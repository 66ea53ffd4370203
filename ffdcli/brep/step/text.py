"""Numbers as the text of STEP files, whole arrays at once.

Reals are printed by orjson: the shortest text that names the same double, in some tens of
nanoseconds. JSON writes an exponent as ``1e-7``; Part 21 asks for ``1.E-7`` (ISO 10303-21, 6.4.2).
"""

from __future__ import annotations

import numpy as np
import orjson

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.errors import KernelError

_EXPONENT, _DOT = ord("E"), ord(".")
_NULL = b"null"


def real_rows(rows: Floats) -> list[bytes]:
    """The text of each row (n, k) of finite reals, with commas between them.

    Raises
    ------
    KernelError
        A number is not finite.
    """
    if not rows.size:
        return [b""] * len(rows)
    text = orjson.dumps(np.ascontiguousarray(rows), option=orjson.OPT_SERIALIZE_NUMPY)
    if _NULL in text:
        raise KernelError("a number is not finite: no STEP file can hold it")
    if b"e" in text:
        text = _with_dots(text.replace(b"e", b"E"))
    return text[2:-2].split(b"],[")


def real(value: float) -> bytes:
    """The text of one finite real."""
    return real_rows(np.array([[value]], dtype=np.float64))[0]


def references(numbers: Ints) -> bytes:
    """References to entities, with commas between them."""
    return b",".join([b"#%d" % number for number in numbers.tolist()])


def _with_dots(text: bytes) -> bytes:
    """The text with a dot between a digit that stands alone and its exponent."""
    data = np.frombuffer(text, dtype=np.uint8)
    at = np.flatnonzero(data == _EXPONENT)
    before = data[at - 2]
    lone = at[(before != _DOT) & ((before < ord("0")) | (before > ord("9")))]
    return np.insert(data, lone, _DOT).tobytes() if len(lone) else text


def rounded(values: Floats, digits: int) -> Floats:
    """Doubles nearest to the decimal numbers of some significant digits that are nearest to values.

    Parameters
    ----------
    values : (...) float64
    digits : int
        17 and more leave all values as they are.

    Returns
    -------
    (...) float64
        The values that OpenCascade's files hold, which it prints with ``%.{digits - 1}E``.
    """
    if digits >= 17:
        return values
    flat = values.ravel()
    with np.errstate(divide="ignore"):
        exponent = np.where(flat == 0, 0.0, np.floor(np.log10(np.abs(flat))))
    shift = (digits - 1 - exponent).astype(np.int64)
    # Powers of ten are doubles up to 1e22; elsewhere, and near ties, Python rounds exactly.
    power = 10.0 ** np.clip(np.abs(shift), 0, 22)
    up = shift >= 0
    with np.errstate(over="ignore"):
        scaled = np.where(up, flat * power, flat / power)
        whole = np.rint(scaled)
        out = np.where(up, whole / power, whole * power)
    doubtful: Bools = (np.abs(shift) > 22) | ~(np.abs(scaled - whole) < 0.49)
    size = np.abs(whole)
    doubtful |= (size >= 10.0**digits) | ((size < 10.0 ** (digits - 1)) & (flat != 0))
    for place in np.flatnonzero(doubtful).tolist():
        out[place] = float(f"{flat[place]:.{digits - 1}E}")
    return out.reshape(values.shape)
