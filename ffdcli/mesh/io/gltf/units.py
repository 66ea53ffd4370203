"""Unit of a glTF file: the metre by the standard, or what its ``extras`` state, as trimesh does."""

from __future__ import annotations

from collections.abc import Iterable

from ffdcli.mesh.io.gltf.entries import Entry, Unreadable
from ffdcli.units import unit_in_words

# The unit where nothing is stated (3.4 of the standard).
_STANDARD = "m"


def read_unit(
    root: Entry, scene: Entry, placed: Iterable[tuple[Entry, Entry]]
) -> tuple[str | None, tuple[str, ...]]:
    """The unit of all meshes that are placed, None for one that is not known; and notes.

    Parameters
    ----------
    placed : iterable of (Entry, Entry)
        Meshes and their nodes. What a mesh states counts before what its node states, then what the
        scene and the file state.

    Raises
    ------
    Unreadable
        They are of several units.
    """
    above = (scene, root.entry("asset"), root)
    words = {_first((*pair, *above)) for pair in placed}
    known = {word: unit_in_words(word) for word in words}
    units = {unit or word for word, unit in known.items()}
    if len(units) > 1:
        raise Unreadable(
            f"its parts are in several units: {', '.join(sorted(map(_shown, units)))}",
            "export it in one unit, or the parts of each unit by themselves",
        )
    unknown = [word for word, unit in known.items() if unit is None]
    note = "the unit {} that the file states is not known here: it is left out"
    return next(iter(known.values()), _STANDARD), tuple(note.format(_shown(w)) for w in unknown)


def _first(entries: Iterable[Entry]) -> str:
    """The unit that the first entry which states one states."""
    for entry in entries:
        extras = entry.values.get("extras")
        if isinstance(extras, dict) and isinstance(extras.get("units"), str):
            return Entry(extras).text("units")
    return _STANDARD


def _shown(word: str) -> str:
    return repr(word[:40])
