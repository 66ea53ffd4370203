"""The verdict on a lattice and a mesh: does the deformation fold the model over?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.errors import LatticeError
from ffdcli.folds.certificate import certify
from ffdcli.folds.global_conditions import is_monotone, keeps_boundary
from ffdcli.folds.model import ModelInBox, place_in_box
from ffdcli.folds.scaling import ScaleLimit, find_scale_limit
from ffdcli.mesh import Mesh, shells
from ffdcli.messages import place_text
from ffdcli.volume.protocol import LatticeMap

if TYPE_CHECKING:
    from ffdcli.lattice import BoxLattice, Lattice

# Scales of the edits beyond this are of no interest.
MOST_SCALE = 16.0
# Scales stay this far from where a weight vanishes.
_WEIGHT_ROOM = 0.99
_SIDES = ("u_min", "v_min", "w_min"), ("u_max", "v_max", "w_max")


@dataclass(frozen=True)
class Injectivity:
    """Whether the deformation is injective on the part of the lattice box that holds the model.

    That part is the mesh's surface there, and the inside of closed bodies.

    Parameters
    ----------
    injective : {"yes", "no", "unproved"}
        Locally, everywhere in the model: proved, disproved by a point, or neither.
    bound : float or None
        A proved lower bound of det J there (of ``-det J`` where mirrored); None with "no", and
        where there was too much to look at.
    one_to_one : bool
        Proved too that no two points of the model are taken to the same place, so that the result
        does not cross itself. False says nothing.
    mirrored : bool
        The deformation turns the model into its mirror image; det J is negative then.
    at : (3,) float64 or None, model length
        With "no", a point of the undeformed model where the deformation is folded.
    value : float or None
        det J there: negative, or where the rest is mirrored positive.
    sampled : bool
        Only points were looked at: the map has no polynomials that would prove anything.
    """

    injective: Literal["yes", "no", "unproved"]
    bound: float | None
    one_to_one: bool = False
    mirrored: bool = False
    at: Floats | None = None
    value: float | None = None
    sampled: bool = False

    @property
    def report(self) -> dict[str, Any]:
        """The report's `jacobian`."""
        facts: dict[str, Any] = {"injective": self.injective}
        if self.at is None:
            facts["bound"] = self.bound
            facts["global"] = "yes" if self.one_to_one else "unproved"
        else:
            facts |= {"at": self.at.tolist(), "value": self.value}
        return facts | ({"mirrored": True} if self.mirrored else {})

    @property
    def problem(self) -> str | None:
        """One sentence on what is wrong; None where injectivity is proved."""
        if self.at is not None:
            among = ", unlike elsewhere" if self.mirrored else ""
            return (
                f"the lattice folds the model over: det J is {self.value:.3g}{among} "
                f"at {place_text(self.at)} of the undeformed model"
            )
        if self.sampled:
            return (
                "it was not proved that the lattice does not fold the model over: with `embedding: "
                "inverse` only its vertices and the middles of its faces are looked at"
            )
        if self.injective == "unproved" and self.bound is None:
            return (
                "it was not looked into whether the lattice folds the model over: the model lies "
                "in too many cells of high degree"
            )
        if self.injective == "unproved":
            return (
                "it could not be proved that the lattice does not fold the model over: "
                f"the bound of det J is {self.bound:.3g}"
            )
        return None


def judge(lattice: Lattice, models: Sequence[ModelInBox]) -> Injectivity:
    """Certify the deformation of a mesh by a lattice, or by each of several.

    Parameters
    ----------
    lattice : Lattice
        Settled by the mesh.
    models : sequence of ModelInBox
        The mesh in the box of each; see :func:`~ffdcli.folds.model.place_in_each`.
    """
    pairs = zip(lattice.members, models, strict=True)
    verdicts = [_judge(member, model) for member, model in pairs]
    if len(verdicts) == 1:
        return verdicts[0]
    folded = next((verdict for verdict in verdicts if verdict.injective == "no"), None)
    if folded is not None:
        return folded
    proved = all(verdict.injective == "yes" for verdict in verdicts)
    # Boxes that are mapped onto themselves stay apart as they are.
    apart = proved and all(keeps_boundary(volume) for volume in lattice.volumes)
    bounds = [verdict.bound for verdict in verdicts if verdict.bound is not None]
    return Injectivity(
        "yes" if proved else "unproved",
        min(bounds) if len(bounds) == len(verdicts) else None,
        apart,
        any(verdict.mirrored for verdict in verdicts),
    )


def _judge(lattice: BoxLattice, model: ModelInBox) -> Injectivity:
    volume = lattice.map
    if model.empty:
        return Injectivity("yes", 1.0, one_to_one=True)
    if volume.needs_fit:
        return _sampled(volume, model)
    sign = certify(volume, model, may_mirror=not lattice.crossed)
    mirrored = sign.sense < 0
    if sign.at is not None and sign.value is not None:
        at = volume.frame.to_model(sign.at)
        return Injectivity("no", None, mirrored=mirrored, at=at, value=sign.sense * sign.value)
    one_to_one = sign.injective == "yes" and _is_one_to_one(lattice, model)
    return Injectivity(sign.injective, sign.bound, one_to_one, mirrored)


def injective_scale(mesh: Mesh, lattice: Lattice, *, most: float = MOST_SCALE) -> ScaleLimit:
    """The largest s such that every ``lattice.scaled(s')`` with s' from 0 to s is injective.

    Parameters
    ----------
    mesh : Mesh
    lattice : Lattice
        Settled by the mesh.
    most : float
        Scales beyond this are not looked at, nor those that would make a weight vanish.

    Returns
    -------
    ScaleLimit
        Up to ``proved`` it is proved; at ``folds``, little more, the point ``at`` (model
        coordinates) of the undeformed model is folded. ``folds`` is None where nothing was found
        to fold.

    Raises
    ------
    LatticeError
        The lattice is not settled, or has no polynomials to tell it from, or ``most`` is not
        greater than 0.
    """
    if not most > 0 or not np.isfinite(most):
        raise LatticeError(f"there is no range of scales up to {most}", file=lattice.source.name)
    if lattice.needs_fit:
        message = "how far edits can be scaled is not told with `embedding: inverse`"
        raise LatticeError(message, file=lattice.source.name)
    limits = [_limit(mesh, member, most) for member in lattice.members]
    first = min(limits, key=lambda limit: np.inf if limit.folds is None else limit.folds)
    return replace(first, proved=min(limit.proved for limit in limits))


def _sampled(volume: LatticeMap, model: ModelInBox) -> Injectivity:
    """The verdict on a map that is no polynomial: folds can be found, but not ruled out."""
    at = model.samples
    values = np.linalg.det(model.slopes(volume))
    worst = int(np.argmin(values))
    if values[worst] > 0:
        return Injectivity("unproved", None, sampled=True)
    place = volume.frame.to_model(at[worst][None])[0]
    return Injectivity("no", None, at=place, value=float(values[worst]))


def _limit(mesh: Mesh, lattice: BoxLattice, most: float) -> ScaleLimit:
    volume = lattice.volume
    model = place_in_box(mesh, shells(mesh), volume)
    if model.empty:
        return ScaleLimit(most)
    before = volume.rest_weights
    lost = before - lattice.weights
    if np.any(lost > 0):
        most = min(most, _WEIGHT_ROOM * float((before[lost > 0] / lost[lost > 0]).min()))
    limit = find_scale_limit(lambda s: lattice.scaled(s).volume, model, most)
    at = None if limit.at is None else volume.frame.to_model(limit.at)
    return ScaleLimit(limit.proved, limit.folds, at, limit.value)


def _is_one_to_one(lattice: BoxLattice, model: ModelInBox) -> bool:
    """By either of the sufficient conditions; the cheaper one first."""
    volume = lattice.volume
    low, high = model.corners.min(axis=(0, 1)), model.corners.max(axis=(0, 1))
    beyond = (volume.box[0] - low > model.slack, high - volume.box[1] > model.slack)
    passed = {
        side for ends, out in zip(_SIDES, beyond, strict=True) for side in np.array(ends)[out]
    }
    # Across sides that the mesh passes without crossing them D may jump.
    continuous = passed == set(lattice.crossed)
    if continuous and is_monotone(volume, model.bounds, reaches_out=bool(passed)):
        return True
    return keeps_boundary(volume)
