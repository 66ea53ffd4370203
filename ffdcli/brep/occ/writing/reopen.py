"""Written CAD files opened again: their structure, read as receivers' parsers read it."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Bools, Bytes, Ints
from ffdcli.brep.occ.formats import is_whole_brep
from ffdcli.errors import KernelError

# Bytes of a text that OpenCascade's scanner holds.
_LONGEST_TEXT = 16_384
STEP_BEGIN, STEP_END = b"ISO-10303-21;\nHEADER;", b"ENDSEC;\nEND-ISO-10303-21;\n"
# Bytes of an IGES line with its end; the letter of its section, then its number.
_LINE, _LETTER = 81, 72
# Parameters of an IGES global section, each of them required by some reader.
_GLOBALS = 26
_HOLLERITH = re.compile(r" *(\d+)H")


def require_readable(kind: str, content: bytes | memoryview) -> None:
    """Reject a file whose structure a receiver's parser would not read as it was meant.

    It takes a seventh of the time of writing; OpenCascade's own parser takes half of it.

    Parameters
    ----------
    kind : {"STEP", "IGES", "BREP"}
    content : bytes

    Raises
    ------
    KernelError
        Naming the first fault.
    """
    fault = _FAULTS[kind](content)
    if fault:
        raise KernelError(
            f"the {kind} file could not be read again: {fault}",
            hint="nothing was written; please report it with the files",
        )


def step_fault(content: bytes | memoryview) -> str:
    """The first fault in the structure of a STEP file (ISO 10303-21); empty if there is none.

    Texts must end in the same place by the standard, which doubles apostrophes, and for
    OpenCascade's scanner, which ends a text at any apostrophe before a parenthesis or comma.
    """
    content = bytes(content)
    if not (content.startswith(STEP_BEGIN) and content.endswith(STEP_END)):
        return "its first or last line is missing"
    fault, defined, numbers = _read_statements(content)
    if fault:
        return fault
    if (np.diff(defined) <= 0).any():
        return f"entity #{defined[1:][np.argmax(np.diff(defined) <= 0)]} is out of order"
    known = np.zeros(numbers.max(initial=0) + 1, dtype=bool)
    known[defined] = True
    if not known[numbers].all():
        return f"entity #{numbers[np.argmin(known[numbers])]} is missing"
    return "" if len(defined) else "it has no entities"


def _read_statements(content: bytes) -> tuple[str, Ints, Ints]:
    """The statements of a STEP file.

    Returns
    -------
    str
        The first fault; empty if there is none.
    (m,), (p,) int64
        Numbers of the entities that are defined, and all numbers of entities.
    """
    none = np.zeros(0, dtype=np.int64)
    data = np.frombuffer(content, dtype=np.uint8)
    # Bytes have the fastest table look-up.
    places = np.flatnonzero(np.frombuffer(content.translate(_NOTED), dtype=np.bool_))
    kinds = data[places]
    if (wrong := ~_TEXT[kinds]).any():
        at = places[np.argmax(wrong)]
        return f"byte {at} is no character of such files", none, none
    quotes = kinds == ord("'")
    fault = _text_fault(data, places[quotes])
    if fault:
        return fault, none, none
    # Outside all texts an even number of apostrophes precedes.
    outside = ~quotes & (np.cumsum(quotes, dtype=np.int32) & 1 == 0)
    places, kinds = places[outside], kinds[outside]
    depth = np.cumsum(_DEEPER[kinds], dtype=np.int32)
    ends = kinds == ord(";")
    if depth.min(initial=0) < 0 or depth[ends].any():
        at = places[np.argmax((depth < 0) | (ends & (depth != 0)))]
        return f"the parentheses of the statement at byte {at} do not match", none, none
    hashes = kinds == ord("#")
    numbers = _numbers_at(data, places[hashes] + 1)
    # A statement of the data section begins with the number of its entity.
    begins = np.r_[True, ends[:-1]][hashes]
    return "", numbers[begins], numbers


def _text_fault(data: Bytes, quotes: Ints) -> str:
    """The first fault of the texts between apostrophes; empty if there is none."""
    if len(quotes) % 2:
        return "a text has no end"
    # A text may end where the statements do.
    data, following = np.append(data, np.uint8(0)), quotes + 1
    while (skipped := _SKIPPED[data[following]]).any():
        following = following + skipped
    ending = _ENDS_TEXT[data[following]]
    closing = np.arange(len(quotes)) % 2 == 1
    doubled = np.r_[np.diff(quotes) == 1, False] & closing
    again = np.r_[False, doubled[:-1]]
    wrong = (closing & ~doubled & ~ending) | (again & ending)
    if wrong.any():
        return f"the text at byte {quotes[np.argmax(wrong)]} ends where it should not"
    starts, stops = quotes[~closing & ~again], quotes[closing & ~doubled]
    if (stops - starts >= _LONGEST_TEXT).any():
        return f"the text at byte {starts[np.argmax(stops - starts)]} is too long"
    return ""


def _numbers_at(data: Bytes, places: Ints) -> Ints:
    """The unsigned integer, of at most 16 digits, that begins at each place."""
    # Eight bytes from each place on, as one number each.
    padded = np.concatenate([data, np.zeros(16, dtype=np.uint8)])
    words = np.ndarray((len(data) + 8,), dtype="<u8", buffer=padded, strides=(1,))
    numbers, digits = _leading_number(words[places])
    long = np.flatnonzero(digits == 8)
    if len(long):
        more, count = _leading_number(words[places[long] + 8])
        numbers[long] = numbers[long] * 10**count + more
    return numbers


def _leading_number(words: NDArray[np.uint64]) -> tuple[Ints, Ints]:
    """The digits with which eight bytes each begin, as a number, and how many there are.

    All bytes of a word are worked on at once; pairs of digits are joined, then pairs of pairs.
    """
    digits = words ^ np.uint64(0x3030303030303030)
    # The highest bit of each byte that is no digit.
    other = ((digits & np.uint64(_SEVEN)) + np.uint64(0x7676767676767676)) | digits
    other &= np.uint64(_EIGHTH)
    lowest = other & (~other + np.uint64(1))
    # Bytes below the lowest one that is no digit: 8 if there is none.
    count = np.bitwise_count(lowest - np.uint64(1)).astype(np.int64) // 8
    shift = (8 * (8 - count)).astype(np.uint64)
    # A shift by all 64 bits is not defined.
    digits = np.where(count > 0, digits << np.minimum(shift, np.uint64(56)), np.uint64(0))
    for bits, mask, factor in _PAIRS:
        low, high = digits & mask, (digits >> bits) & mask
        digits = low * factor + high
    return digits.astype(np.int64), count


def iges_fault(content: bytes | memoryview) -> str:
    """The first fault in the sections of an IGES file; empty if there is none."""
    data = np.frombuffer(content, dtype=np.uint8)
    if len(data) % _LINE or (data[_LINE - 1 :: _LINE] != ord("\n")).any():
        return "its lines do not have 80 characters"
    lines = data.reshape(-1, _LINE)
    if not (_TEXT[lines[:, :-1]]).all():
        return "it holds characters that are not printable ASCII"
    letters = bytes(lines[:, _LETTER])
    counts = {letter: letters.count(letter) for letter in b"SGDPT"}
    if letters != b"".join(bytes([letter]) * count for letter, count in counts.items()):
        return "its sections are not in order"
    own = np.concatenate([np.arange(1, count + 1) for count in counts.values()])
    wrong = _columns(lines, _LETTER + 1, 80) != own
    if wrong.any():
        return f"line {np.argmax(wrong) + 1} has the wrong number"
    last = bytes(lines[-1, :32])
    stated = [last[at : at + 1] + b"%d" % int(last[at + 1 : at + 8]) for at in range(0, 32, 8)]
    if stated != [b"%c%d" % (letter, counts[letter]) for letter in b"SGDP"]:
        return "the counts in its last line are wrong"
    first = counts[ord("S")]
    section = bytes(lines[first : first + counts[ord("G")], :_LETTER]).decode("ascii")
    found = _parameters(section)
    if len(found) != _GLOBALS:
        return f"its global section has {len(found)} parameters instead of {_GLOBALS}"
    first += counts[ord("G")]
    directory = lines[first : first + counts[ord("D")]]
    begin, count = _columns(directory[::2], 8, 16), _columns(directory[1::2], 24, 32)
    if (begin != 1 + np.cumsum(np.r_[0, count[:-1]])).any() or count.sum() != counts[ord("P")]:
        return "its directory does not fit its parameters"
    owners = _columns(lines[first + counts[ord("D")] : -1], 64, 72)
    if (owners != np.repeat(1 + 2 * np.arange(len(count)), count)).any():
        return "its parameters do not fit its directory"
    return ""


def _columns(lines: Bytes, begin: int, end: int) -> Ints:
    """(n,) the integers in these columns of lines, blanks counting as leading zeros."""
    digits = np.maximum(lines[:, begin:end].astype(np.int64) - ord("0"), 0)
    return np.asarray(digits @ 10 ** np.arange(end - begin - 1, -1, -1))


def _parameters(section: str) -> list[str]:
    """The parameters of a global section; texts are preceded by their length (``5Htext,``)."""
    found: list[str] = []
    at = 0
    while at < len(section) and not (found and section[at - 1] == ";"):
        begin, length = at, _HOLLERITH.match(section, at)
        if length:
            at = length.end() + int(length[1])
        else:
            while at < len(section) and section[at] not in ",;":
                at += 1
        found.append(section[begin:at])
        if section[at : at + 1] not in (",", ";"):
            break
        at += 1
    return found


def brep_fault(content: bytes | memoryview) -> str:
    """The first fault in the structure of a .brep file; empty if there is none."""
    return "" if is_whole_brep(bytes(content)) else "it does not hold all shapes that it announces"


def _table(characters: bytes) -> Bools:
    """(256,) whether each byte is one of these characters."""
    table = np.zeros(256, dtype=bool)
    table[list(characters)] = True
    return table


_TEXT = _table(bytes(range(32, 127)) + b"\n")
# 1 for marks, and for bytes that are no characters of such files.
_NOTED = (~_TEXT | _table(b"'();#")).astype(np.uint8).tobytes()
_DEEPER = np.zeros(256, dtype=np.int8)
_DEEPER[ord("(")], _DEEPER[ord(")")] = 1, -1
_ENDS_TEXT = _table(b"),")
_SEVEN, _EIGHTH = 0x7F7F7F7F7F7F7F7F, 0x8080808080808080
_PAIRS = tuple(
    (np.uint64(bits), np.uint64(mask), np.uint64(factor))
    for bits, mask, factor in (
        (8, 0x00FF00FF00FF00FF, 10),
        (16, 0x0000FFFF0000FFFF, 100),
        (32, 0x00000000FFFFFFFF, 10_000),
    )
)
# What OpenCascade's scanner allows between the end of a text and the parenthesis or comma.
_SKIPPED = _table(b'" \n')
_FAULTS = {"STEP": step_fault, "IGES": iges_fault, "BREP": brep_fault}
