"""Verdicts on a lattice and a mesh: whether the deformation folds the model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.errors import LatticeError
from ffdcli.folds.certificate import certify
from ffdcli.folds.global_conditions import is_monotone, keeps_boundary
from ffdcli.folds.model import SPREAD, ModelInBox, place_in_each
from ffdcli.folds.scaling import EFFORT, ScaleLimit, find_scale_limit, is_close, sampled_limit
from ffdcli.mesh import Mesh, shells
from ffdcli.messages import place_text
from ffdcli.stopwatch import Progress
from ffdcli.volume.protocol import LatticeMap, Volume

if TYPE_CHECKING:
    from ffdcli.lattice import BoxLattice, Lattice

# Largest scale of the edits that is examined.
MOST_SCALE = 16.0
# Share of the scale at which a weight vanishes that is examined.
_WEIGHT_ROOM = 0.99
_SIDES = ("u_min", "v_min", "w_min"), ("u_max", "v_max", "w_max")


@dataclass(frozen=True)
class Injectivity:
    """Whether the deformation is injective on the part of the lattice box that holds the model.

    That part is the mesh's surface there, and the inside of closed bodies.

    Parameters
    ----------
    locally_injective : {"yes", "no", "unproved"}
        Whether det J keeps its sign all over the model: proved, disproved by a point, or neither.
    bound : float or None
        A proved lower bound of det J there (of ``-det J`` where mirrored); None with "no", and
        where the cells are too many for a proof; -inf where weights are too far apart for one.
    globally_injective : bool
        True where it is proved that no two points of the model have the same image, so that the
        result does not intersect itself. False where that is not known.
    mirrored : bool
        True where det J is negative all over the model: the result is mirrored.
    at : (3,) float64 or None, model length
        With "no", a point of the undeformed model where the deformation is folded.
    value : float or None
        det J at that point: negative, or positive where the rest is mirrored.
    sampled : bool
        True where only sample points were examined, since the map has no polynomial pieces.
    scale : float or None
        With "no", where a field was fitted: scales of it up to this one are proved not to fold.
    folded : float or None
        With "no", the share of the surface of the undeformed model, measured at ``SPREAD`` points,
        where det J has the wrong sign. The model may be folded inside only; then it is 0.
    """

    locally_injective: Literal["yes", "no", "unproved"]
    bound: float | None
    globally_injective: bool = False
    mirrored: bool = False
    at: Floats | None = None
    value: float | None = None
    sampled: bool = False
    folded: float | None = None
    scale: float | None = None

    @property
    def report(self) -> dict[str, Any]:
        """The `jacobian` section of the report."""
        facts: dict[str, Any] = {"injective": self.locally_injective}
        if self.at is None:
            facts["bound"] = self.bound if self.bound != -math.inf else None
            facts["global"] = "yes" if self.globally_injective else "unproved"
        else:
            facts |= {"at": self.at.tolist(), "value": self.value}
            facts["folded"] = {"share": self.folded, "samples": SPREAD}
            facts |= {} if self.scale is None else {"scale": self.scale}
        return facts | ({"mirrored": True} if self.mirrored else {})

    @property
    def problem(self) -> str | None:
        """A sentence for users; None where injectivity is proved."""
        if self.at is not None:
            among = ", unlike elsewhere" if self.mirrored else ""
            return (
                f"the lattice folds the model over: det J is {self.value:.3g}{among} "
                f"at {place_text(self.at)} of the undeformed model; {self.folded:.2%} of its "
                f"surface is folded, by {SPREAD:,} points{self._largest}"
            )
        if self.sampled:
            return (
                "it is not proved that the lattice does not fold the model over: with `embedding: "
                "inverse` only its vertices and the centres of its triangles are examined"
            )
        if self.locally_injective == "unproved" and self.bound is None:
            return (
                "it was not examined whether the lattice folds the model over: the model lies in "
                "too many cells of high degree"
            )
        if self.locally_injective == "unproved":
            known = f"the bound of det J is {self.bound:.3g}"
            if self.bound == -math.inf:
                known = "weights are too far apart to bound det J"
            return f"it could not be proved that the lattice does not fold the model over: {known}"
        return None

    @property
    def _largest(self) -> str:
        # Nothing is proved where the effort allowed was spent.
        if not self.scale:
            return ""
        return f"; scaled by up to {self.scale:.4g} the field does not fold it"

    @property
    def hint(self) -> str:
        """Hint for a result that fails a check: the fold that explains it, where there is one."""
        return f"nothing was written; {self.problem or 'please report it with the files'}"


def judge(lattice: Lattice, models: Sequence[ModelInBox]) -> Injectivity:
    """Certify the deformation of a mesh by a lattice, box by box.

    Parameters
    ----------
    lattice : Lattice
        Settled by the mesh.
    models : sequence of ModelInBox
        The mesh in each box; see :func:`~ffdcli.folds.model.place_in_each`.
    """
    pairs = zip(lattice.members, models, strict=True)
    verdicts = [_judge(member, model) for member, model in pairs]
    found = next((verdict for verdict in verdicts if verdict.locally_injective == "no"), None)
    if found is not None:
        # A field is data: what of it can be had is told without being asked.
        told = bool(lattice.fits) and not lattice.needs_fit
        limit = _scale_limit(lattice, models, 1.0, EFFORT // 4) if told else None
        folded = _share_folded(lattice, models, verdicts)
        return replace(found, folded=folded, scale=None if limit is None else limit.proved)
    if len(verdicts) == 1:
        return verdicts[0]
    proved = all(verdict.locally_injective == "yes" for verdict in verdicts)
    # Disjoint boxes that are mapped onto themselves have disjoint images.
    apart = proved and all(keeps_boundary(volume) for volume in lattice.volumes)
    bounds = [verdict.bound for verdict in verdicts if verdict.bound is not None]
    return Injectivity(
        "yes" if proved else "unproved",
        min(bounds) if len(bounds) == len(verdicts) else None,
        apart,
        any(verdict.mirrored for verdict in verdicts),
        sampled=any(verdict.sampled for verdict in verdicts),
    )


def _judge(lattice: BoxLattice, model: ModelInBox) -> Injectivity:
    volume = lattice.map
    if model.empty:
        return Injectivity("yes", 1.0, globally_injective=True)
    if volume.needs_fit:
        return _sampled(volume, model)
    sign = certify(volume, model, may_mirror=not lattice.crossed)
    mirrored = sign.sense < 0
    if sign.at is not None and sign.value is not None:
        at = volume.frame.to_model(sign.at)
        return Injectivity("no", None, mirrored=mirrored, at=at, value=sign.sense * sign.value)
    globally_injective = sign.locally_injective == "yes" and _is_globally_injective(lattice, model)
    return Injectivity(sign.locally_injective, sign.bound, globally_injective, mirrored)


def _share_folded(
    lattice: Lattice, models: Sequence[ModelInBox], verdicts: Sequence[Injectivity]
) -> float:
    """Share of points spread over the mesh where det J has the wrong sign; boxes are disjoint."""
    count = 0
    for member, model, verdict in zip(lattice.members, models, verdicts, strict=True):
        if verdict.locally_injective == "no":
            determinants = np.linalg.det(member.map.jacobian(model.spread))
            count += int(((-determinants if verdict.mirrored else determinants) < 0).sum())
    return count / SPREAD


def injective_scale(
    mesh: Mesh,
    lattice: Lattice,
    *,
    most: float = MOST_SCALE,
    progress: Progress | None = None,
) -> ScaleLimit:
    """The largest s such that every ``lattice.scaled(s')`` with s' from 0 to s is injective.

    Parameters
    ----------
    mesh : Mesh
    lattice : Lattice
        Settled by the mesh.
    most : float
        Largest scale that is examined; scales that make a weight vanish are excluded.
    progress : callable, optional
        Called with a few words before each step.

    Returns
    -------
    ScaleLimit
        Scales up to ``proved`` are proved injective; at ``folds``, slightly more, the deformation
        is folded at the point ``at`` (model coordinates) of the undeformed model. ``folds`` is None
        where no fold was found. The effort is bounded, to ten to twenty seconds; where it did not
        suffice, ``complete`` is False and nothing is known of scales between the two.

    Raises
    ------
    LatticeError
        The map has no polynomial pieces, or ``most`` is not greater than 0.
    """
    if not most > 0 or not np.isfinite(most):
        message = f"the largest scale must be a positive number, not {most}"
        raise LatticeError(message, file=lattice.source.name)
    if lattice.needs_fit:
        message = "with `embedding: inverse` no limit of the scale can be proved"
        raise LatticeError(message, file=lattice.source.name)
    placed = place_in_each(mesh, shells(mesh), lattice.volumes)
    return _scale_limit(lattice, placed, most, EFFORT, progress)


def _scale_limit(
    lattice: Lattice,
    placed: Sequence[ModelInBox],
    most: float,
    allowed: int,
    progress: Progress | None = None,
) -> ScaleLimit:
    """The largest scale, found with a number of multiplications."""
    jobs = [
        _Scaling(member, model, min(most, _weight_room(member)))
        for member, model in zip(lattice.members, placed, strict=True)
        if not model.empty
    ]
    if len(jobs) > 1:
        # Where folds come first the others need not be scaled further.
        jobs.sort(key=lambda job: job.sampled)
    limit = ScaleLimit(most)
    for number, job in enumerate(jobs):
        # What one leaves of its share of the effort serves the others.
        effort = (allowed - limit.effort) // (len(jobs) - number)
        end = min(job.most, limit.folds or most)
        found = find_scale_limit(job.scaled, job.model, end, effort, progress)
        best = limit
        if found.folds is not None and found.at is not None:
            best = replace(found, at=job.member.volume.frame.to_model(found.at))
        limit = replace(
            best,
            proved=min(limit.proved, found.proved),
            complete=limit.complete and found.complete,
            steps=limit.steps + found.steps,
            effort=limit.effort + found.effort,
        )
    if limit.folds is None:
        return limit
    return replace(limit, complete=is_close(limit.proved, limit.folds))


@dataclass(frozen=True)
class _Scaling:
    """The largest scale to examine of one lattice, and the mesh in its box."""

    member: BoxLattice
    model: ModelInBox
    most: float

    def scaled(self, scale: float) -> Volume:
        """The volume at a scale."""
        return self.member.scaled(scale).volume

    @property
    def sampled(self) -> float:
        """The smallest scale that folds sample points; infinite where none does."""
        folds = sampled_limit(self.scaled, self.model, self.most).folds
        return np.inf if folds is None else folds


def _weight_room(lattice: BoxLattice) -> float:
    """A scale shortly before a weight vanishes; infinite where none does."""
    before = lattice.volume.rest_weights
    lost = before - lattice.weights
    if not np.any(lost > 0):
        return np.inf
    return _WEIGHT_ROOM * float((before[lost > 0] / lost[lost > 0]).min())


def _sampled(volume: LatticeMap, model: ModelInBox) -> Injectivity:
    """The verdict on a map without polynomial pieces: folds can be found, but not excluded."""
    at = model.samples
    values = np.linalg.det(model.slopes(volume))
    worst = int(np.argmin(values))
    if values[worst] > 0:
        return Injectivity("unproved", None, sampled=True)
    place = volume.frame.to_model(at[worst][None])[0]
    return Injectivity("no", None, at=place, value=float(values[worst]))


def _is_globally_injective(lattice: BoxLattice, model: ModelInBox) -> bool:
    """Whether one of the two sufficient conditions holds; the cheaper one is tested first."""
    volume = lattice.volume
    low, high = model.corners.min(axis=(0, 1)), model.corners.max(axis=(0, 1))
    beyond = (volume.box[0] - low > model.slack, high - volume.box[1] > model.slack)
    passed = {
        side for ends, out in zip(_SIDES, beyond, strict=True) for side in np.array(ends)[out]
    }
    # D may be discontinuous across sides that the mesh passes without crossing them.
    continuous = passed == set(lattice.crossed)
    if continuous and is_monotone(volume, model.bounds, reaches_out=bool(passed)):
        return True
    return keeps_boundary(volume)
