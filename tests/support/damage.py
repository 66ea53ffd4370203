"""Damage to good files, drawn by hypothesis, and what readers may make of it."""

import numpy as np
from hypothesis import strategies as st

from ffdcli.errors import FfdError
from ffdcli.mesh import describe_remarks, inspect, read_mesh, repair, usability

# What numbers and separators turn into when files are mangled.
BITS = (
    b"-",
    b"1e999",
    b"nan",
    b"9" * 20,
    b" ",
    b"\n",
    b"\0",
    b"1e",
    b"/",
    b".",
    b"1e-" + b"9" * 20,
    b"0",
)


def damage(content, data, bits=BITS):
    """The content with one to four faults."""
    content = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, max(len(content) - 1, 0)))
        kind = data.draw(st.sampled_from(["cut", "byte", "drop", "twice", "bits", "digit"]))
        if kind == "cut":
            del content[at:]
        elif kind == "byte":
            content[at : at + 1] = bytes([data.draw(st.integers(0, 255))])
        elif kind == "drop":
            del content[at : at + data.draw(st.integers(1, 9))]
        elif kind == "twice":
            content[at:at] = content[at : at + data.draw(st.integers(1, 20))]
        elif kind == "bits":
            content[at : at + 1] = data.draw(st.sampled_from(bits))
        else:
            digits = [n for n, character in enumerate(content) if 48 <= character <= 57]
            if digits:
                content[data.draw(st.sampled_from(digits))] = data.draw(st.integers(48, 57))
    return bytes(content)


def require_read_or_refused(path):
    """The file is read, and then can be inspected and repaired; or it is refused in one line."""
    try:
        mesh = read_mesh(path)
    except FfdError as error:
        refusal = error
        mesh = None
    if mesh is None:
        assert refusal.file == str(path)
        assert refusal.hint
        return
    found = inspect(mesh)
    assert usability(mesh, found) in ("yes", "with --repair", "no")
    describe_remarks(mesh, found)
    mended, _ = repair(mesh)
    assert np.isin(mended.corners, np.arange(len(mended.vertices))).all()
    assert repair(mended) == (mended, ())
