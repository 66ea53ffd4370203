"""What is shown of one state of the lattices: vertices, control points, previews, folds."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.deformation import Deformation
from ffdcli.editor.basis import Functions, functions_of
from ffdcli.editor.drawn import Drawn
from ffdcli.editor.nets import Net, net_of
from ffdcli.editor.preview import Preview, Previews
from ffdcli.editor.proofs import Folds, Proof, Stop, folds_of, last_proved, prove
from ffdcli.editor.stages import Stages
from ffdcli.lattice import Lattice


class KeptFunctions:
    """The functions of lattices at the drawn vertices, for the knots that were asked for last."""

    def __init__(self, drawn: Drawn, delta: float) -> None:
        self.drawn, self.delta = drawn, delta
        self._lock = threading.Lock()
        self._rests: tuple[Any, ...] = ()
        self._found: tuple[Functions, ...] = ()

    def of(self, lattice: Lattice) -> tuple[Functions, ...]:
        """The functions of each lattice."""
        rests = tuple(member.control.at_rest for member in lattice.members)
        with self._lock:
            # Each is made once; what differs has other knots.
            if list(map(id, rests)) != list(map(id, self._rests)):
                self._found = functions_of(lattice, self.drawn.rest, self.delta)
                self._rests = rests
            return self._found


@dataclass(frozen=True, eq=False)
class Shown:
    """The lattices with the model, as they are after some edits.

    Parameters
    ----------
    stages : Stages
    lattice : Lattice
    drawn : Drawn
    kept : KeptFunctions
    delta : float, model length
    """

    stages: Stages
    lattice: Lattice
    drawn: Drawn
    kept: KeptFunctions
    delta: float

    @cached_property
    def functions(self) -> tuple[Functions, ...]:
        """The functions of each lattice at the drawn vertices."""
        return self.kept.of(self.lattice)

    @cached_property
    def vertices(self) -> Floats:
        """(V, 3) the drawn vertices as they are, model length."""
        return self._vertices(self.lattice)

    def vertices_at(self, share: float) -> Floats:
        """(V, 3) the drawn vertices with a share of all edits, as of ``Lattice.scaled``."""
        return self.vertices if share == 1 else self._vertices(self.lattice.scaled(share))

    def _vertices(self, lattice: Lattice) -> Floats:
        out = self.drawn.rest.copy()
        for functions, member in zip(self.functions, lattice.members, strict=True):
            out[functions.rows] = functions.images(member)
        return out

    def images(self, points: Floats, share: float = 1.0) -> Floats:
        """Images (m, 3) of undeformed points (m, 3) of the model."""
        return Deformation.of(self.lattice.scaled(share), self.delta).images(points)

    @cached_property
    def nets(self) -> tuple[Net, ...]:
        """Control points of each lattice."""
        return tuple(map(net_of, self.lattice.members))

    def nets_at(self, share: float) -> tuple[Floats, ...]:
        """(m, 3) control points of each lattice with a share of all edits, model length."""
        return tuple(
            member.map.frame.to_model(member.points.reshape(-1, 3))
            for member in self.lattice.scaled(share).members
        )

    @cached_property
    def _previews(self) -> dict[int, Previews]:
        return {}

    def previews(self, number: int) -> Previews:
        """What previews of edits of one lattice need, made once."""
        if number not in self._previews:
            functions, member = self.functions[number], self.lattice.members[number]
            reach = functions.reach(member)
            made = Previews(self.stages, number, member, functions, reach, self.vertices)
            self._previews[number] = made
        return self._previews[number]

    def preview(self, number: int, edits: Sequence[dict[str, Any]]) -> Preview:
        """The drawn vertices and control points after edits of one lattice.

        Raises
        ------
        LatticeError
        """
        vertices, net = self.previews(number).of(edits)
        nets = tuple(net if n == number else each.points for n, each in enumerate(self.nets))
        return Preview(vertices, nets)

    @cached_property
    def folds(self) -> Folds:
        """Whether and where the model is folded."""
        return folds_of(self._apart, self.stages.models)

    @cached_property
    def _apart(self) -> Lattice:
        """The same lattices with caches of their own: proofs may run beside previews."""
        members = tuple(
            each.with_points(each.points, each.weights) for each in self.lattice.members
        )
        return replace(self.lattice, members=members)

    @cached_property
    def _proofs(self) -> dict[int, Proof]:
        return {}

    def last_proved(self, number: int, edits: Sequence[dict[str, Any]]) -> Stop:
        """How far edits of one lattice go until they are not proved to fold nothing.

        Raises
        ------
        LatticeError
        """
        member, model = self._apart.members[number], self.stages.models[number]
        if number not in self._proofs:
            self._proofs[number] = prove(member, model)
        return last_proved(
            edits,
            lambda some: self.stages.extended(number, member, some),
            member,
            model,
            self._proofs[number],
            size=float(np.linalg.norm(np.ptp(self.drawn.rest, axis=0))),
        )
