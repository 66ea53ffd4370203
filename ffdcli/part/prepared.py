"""What all deformations of a part by lattices of one basis have in common."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

from ffdcli.part.cover import Cover, cover_edges, cover_faces, cover_points
from ffdcli.part.fit_target import Target
from ffdcli.part.outline import Outline, outlines_of
from ffdcli.part.record import Part

# A face or an edge, its number, the degrees, and how smooth the lattice is across its sides.
TargetKey = tuple[str, int, tuple[int, ...], tuple[tuple[int, ...], ...]]


@dataclass(frozen=True, eq=False)
class PreparedPart:
    """A part with the samples of it that do not depend on the control net.

    Everything is found when it is first asked for, and kept.

    Parameters
    ----------
    part : Part
    targets : dict of TargetKey to Target
        Faces and edges to be fitted, with the knots that their fits begin with.
    """

    part: Part
    targets: dict[TargetKey, Target] = field(default_factory=dict)

    @cached_property
    def outlines(self) -> tuple[Outline, ...]:
        """The outline of every face."""
        return outlines_of(self.part)

    @cached_property
    def face_cover(self) -> Cover:
        """Boxes that cover the faces."""
        return cover_faces(self.part, self.outlines)

    @cached_property
    def edge_cover(self) -> Cover:
        """Boxes that cover the edges."""
        return cover_edges(self.part)

    @cached_property
    def vertex_cover(self) -> Cover:
        """Boxes that cover the vertices."""
        return cover_points(self.part.points)

    def target(self, key: TargetKey, make: Callable[[], Target]) -> Target:
        """The target of a face or an edge."""
        found = self.targets.get(key)
        if found is None:
            found = self.targets[key] = make()
        return found
