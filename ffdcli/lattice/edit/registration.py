"""Registration: which place of the model each point of a scan stands for.

The nearest places are looked for again and again while the model bends towards the scan, stiffly at
first and softer later (Amberg, Romdhani and Vetter 2007). All is in the lattice frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ffdcli.arrays import Bools, Floats
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.edit.fit_edit import ON_BOX, TOLERANCE, basis_at, free_points
from ffdcli.lattice.file.definition import PairTable
from ffdcli.lattice.file.fit_models import Fit
from ffdcli.lattice.file.source import Source
from ffdcli.lattice.fit.planes import PlanePairs, plane_step
from ffdcli.lattice.fit.robust import Neighbours
from ffdcli.lattice.fit.scan_report import ScanReport
from ffdcli.scan.record import Scan
from ffdcli.scan.samples import Samples, take_samples
from ffdcli.scan.surface import Places, divide, nearest_places, spread_out, unit_normals

# Largest distance that counts where none is given, relative to the diagonal of the lattice box.
REACH = 0.1
# Weights of the bending energy, one after the other, and steps with each at most.
_STIFF_TO_SOFT = (1.0, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
_STEPS = 4
# Change of the root mean square distance, as a share, that ends the steps, or the rounds of fits.
_SETTLED = 0.05
_BETTER = 0.97
# One point of so many is left out while the model bends, and judges the weights of the energy. The
# stiffest is taken whose distance is at most this multiple of the least.
_JUDGES = 4
_NO_WORSE = 1.02
_ROUNDS = 5
# Edges of the model's triangles, relative to the size of the box, and most of the triangles.
_EDGE = 1 / 30
_MOST = 100_000
# Another point of the scan much nearer to a place is what that place was scanned as.
_NEARER = 0.5
# Usual distances from the median up to which no point is looked at as one of something else.
_USUAL = 4.0
# Fewest points of a scan near the model.
_FEWEST = 12


@dataclass(frozen=True, eq=False)
class Registration:
    """What a registration found.

    Parameters
    ----------
    lattice : BoxLattice
        Fitted to the pairs.
    pairs : PairTable
        Places of the model and the points of the scan that they are, model coordinates.
    report : ScanReport
    """

    lattice: BoxLattice
    pairs: PairTable
    report: ScanReport


@dataclass(frozen=True, eq=False)
class _Match:
    """The nearest places on the bent model to the points of a scan.

    Parameters
    ----------
    rest : (n, 3) float64
        Places on the model at rest.
    goals : (n, 3) float64
        The points; across from the images, where triangles of the model were left out.
    left : (n, 3) float64
        What the images of the places lack to them.
    normals : (n, 3) float64
        Of the bent model.
    places : Places
    counts : (n,) bool
        Whether the point was scanned from there.
    """

    rest: Floats
    goals: Floats
    left: Floats
    normals: Floats
    places: Places
    counts: Bools

    def rms(self, every: int = 1) -> float:
        """Root mean square distance of the points that count, or one of so many of them."""
        distance = self.places.distance[::every][self.counts[::every]]
        return float(np.sqrt(np.mean(distance**2))) if len(distance) else 0.0

    def largest(self) -> float:
        """Largest distance of a point that counts."""
        return float(self.places.distance[self.counts].max(initial=0.0))


class _Search:
    """A model in small triangles and the points of a scan, for any lattice on the model's box."""

    def __init__(
        self, lattice: BoxLattice, surface: Floats, scan: Scan, reach: float, tolerance: float
    ) -> None:
        """Divide the model, and thin the scan."""
        box = lattice.layout.box
        size = float(np.linalg.norm(box[1] - box[0]))
        low, high = box[0] - ON_BOX * size, box[1] + ON_BOX * size
        touching = np.all((surface.max(axis=1) >= low) & (surface.min(axis=1) <= high), axis=1)
        whole, _ = divide(surface[touching], size * _EDGE)
        small = spread_out(whole, _MOST)
        # Triangles that are left out leave gaps.
        self.gap = size * _EDGE if len(small) < len(whole) else 0.0
        inside = np.all((small >= low) & (small <= high), axis=(1, 2))
        self.corners = small[inside].clip(*box)
        # Equal corners are moved once.
        flat, self.which = np.unique(self.corners.reshape(-1, 3), axis=0, return_inverse=True)
        self.flat = flat
        frame = lattice.map.frame
        self.samples: Samples = take_samples(
            replace(
                scan,
                points=frame.to_local(scan.points),
                normals=None if scan.normals is None else _turned(scan.normals, lattice),
            )
        )
        self.tree = cKDTree(self.samples.points)
        few = len(self.samples.points) < 100
        self.near = None if few else Neighbours.of(self.samples.points, tolerance)
        self.reach, self.tolerance = reach, tolerance

    def bent(self, lattice: BoxLattice) -> Floats:
        """The small triangles (t, 3, 3) as the lattice moves them."""
        return lattice.map.evaluate(self.flat)[self.which.reshape(-1)].reshape(-1, 3, 3)

    def match(self, lattice: BoxLattice) -> _Match:
        """The nearest places, and which of them count."""
        samples, bent = self.samples, self.bent(lattice)
        places = nearest_places(samples.points, bent)
        shares = places.shares[:, :, None]
        rest = (shares * self.corners[places.triangle]).sum(axis=1).clip(*lattice.layout.box)
        normals = unit_normals(bent)[places.triangle]
        images = lattice.map.evaluate(rest)
        left = samples.points - images
        if self.gap:
            across = np.einsum("nc,nc->n", left, normals)
            beside = np.linalg.norm(left - across[:, None] * normals, axis=1) <= self.gap
            left = np.where(beside[:, None], across[:, None] * normals, left)
            distance = np.where(beside, np.abs(across), places.distance)
            places = replace(places, distance=distance)
        found = _Match(rest, images + left, left, normals, places, np.zeros(len(rest), dtype=bool))
        return replace(found, counts=self._counting(found))

    def _counting(self, found: _Match) -> Bools:
        samples, distance = self.samples, found.places.distance
        near = distance <= self.reach
        rows = np.arange(len(distance))
        counts = near & samples.agree(rows, found.normals)
        if not counts.any():
            return counts
        usual = max(_USUAL * float(np.median(distance[counts])), self.tolerance)
        far = np.flatnonzero(counts & (distance > usual))
        # A place whose image another point of the scan is much nearer to.
        if len(far):
            other = self.tree.query(found.places.points[far])[0]
            counts[far[other < _NEARER * distance[far]]] = False
        if self.near is not None:
            ones = np.ones(len(distance))
            left = np.where(near[:, None], found.left, 0.0)
            counts &= self.near.factors(left, ones, 0.0 * ones) >= 0.5
        return counts


def _turned(vectors: Floats, lattice: BoxLattice) -> Floats:
    frame = lattice.map.frame
    return vectors if frame.aligned else np.asarray(vectors @ frame.axes.T)


def register(
    start: BoxLattice,
    surface: Floats,
    scan: Scan,
    edit: Fit,
    source: Source,
    fitted: Callable[[PairTable, float | None], BoxLattice],
) -> Registration:
    """The lattice that bends a model onto a scan.

    Parameters
    ----------
    start : BoxLattice
        Before the edit, on cells for the search; its model is where the scan is looked for.
    surface : (T, 3, 3) float64, lattice frame
        Triangles of the model.
    scan : Scan
        In model coordinates.
    edit : Fit
    source : Source
    fitted : callable
        The lattice fitted to pairs, with a weight of the bending energy or the choice of one.

    Raises
    ------
    LatticeError
        No part of the scan is near the model.
    """
    box = start.layout.box
    size = float(np.linalg.norm(box[1] - box[0]))
    tolerance, reach = edit.tolerance or TOLERANCE * size, edit.reach or REACH * size
    search = _Search(start, surface, scan, reach, tolerance)
    if not len(search.corners):
        raise source.error(("target",), "no surface of the model lies in the lattice box", None)
    match = search.match(start)
    _require_near(match, search, source)
    if match.largest() <= tolerance:
        # Nothing is to move.
        pairs = _pairs(match, start, moved=False)
        return _found(fitted(pairs, None), pairs, search, _Bent(start, None, 1))
    bent = _bent(start, search, match, edit, source)
    rounds, best = bent.rounds, None
    least = np.inf
    match = search.match(bent.lattice)
    for _ in range(_ROUNDS):
        pairs = _pairs(match, start)
        lattice, rounds = fitted(pairs, bent.smooth), rounds + 1
        match = search.match(lattice)
        now = match.rms()
        enough = now > _BETTER * least
        if now < least:
            best, least = (lattice, pairs), now
        if enough or match.largest() <= tolerance:
            break
    assert best is not None
    return _found(*best, search, replace(bent, rounds=rounds))


def _require_near(match: _Match, search: _Search, source: Source) -> None:
    samples = search.samples
    if not len(samples.corners) and samples.normals.any(axis=1).sum() < _FEWEST:
        message = "the points of the scan lie on no surface: none of them has a plane around it"
        raise source.error(("target",), message, "give a scan of a surface, with more points")
    if match.counts.sum() >= _FEWEST:
        return
    near = float(match.places.distance.min())
    message = f"no surface of the scan lies within {search.reach:.4g} of the model, its reach"
    if near > search.reach:
        message += f": the nearest point of the scan is {near:.4g} away"
    hint = "move the scan to where the model is; compare the units; or give a larger `reach`"
    raise source.error(("target",), message, hint)


@dataclass(frozen=True, eq=False)
class _Bent:
    """A lattice bent towards a scan, on its own cells.

    Parameters
    ----------
    lattice : BoxLattice
    smooth : float or None
        Weight of the bending energy beyond which nothing is won; None if less is always better.
    rounds : int
        How often the nearest places were looked for.
    """

    lattice: BoxLattice
    smooth: float | None
    rounds: int


def _bent(start: BoxLattice, search: _Search, match: _Match, edit: Fit, source: Source) -> _Bent:
    """The lattice bent towards the scan, as stiffly as the points left out allow."""
    free = free_points(start, edit, source)
    rounds, moves = 0, np.zeros((start.points.size // 3, 3))
    tried: list[tuple[float, float, BoxLattice]] = []
    for smooth in _STIFF_TO_SOFT:
        last = np.inf
        for _ in range(_STEPS):
            used = match.counts.copy()
            used[::_JUDGES] = False
            basis = basis_at(start, match.rest[used], free)
            pairs = PlanePairs(match.left[used], match.normals[used])
            moves[basis.unknowns] += plane_step(basis, pairs, smooth, moves[basis.unknowns])
            points = start.points + moves.reshape(start.points.shape)
            lattice, rounds = start.with_points(points, start.weights), rounds + 1
            match = search.match(lattice)
            if not np.count_nonzero(match.counts) >= _FEWEST:
                message = "the model cannot be bent onto the scan: no surface of it stays near"
                raise source.error(("target",), message, "move the scan to where the model is")
            now = match.rms()
            if abs(last - now) <= _SETTLED * now or match.largest() <= search.tolerance:
                break
            last = now
        tried.append((match.rms(_JUDGES), smooth, lattice))
        if match.largest() <= search.tolerance:
            break
    least = min(judged for judged, _, _ in tried)
    number = next(n for n, each in enumerate(tried) if each[0] <= _NO_WORSE * least)
    _, smooth, lattice = tried[number]
    if edit.smooth != "auto":
        return _Bent(lattice, edit.smooth, rounds)
    return _Bent(lattice, None if number == len(tried) - 1 else smooth, rounds)


def _pairs(match: _Match, start: BoxLattice, *, moved: bool = True) -> PairTable:
    """The pairs that count, in model coordinates; unless moved, displacements that are 0."""
    frame, rest = start.map.frame, match.rest[match.counts]
    goals = frame.to_model(match.goals[match.counts]) if moved else np.zeros_like(rest)
    count = len(rest)
    return PairTable(frame.to_model(rest), goals, np.full(count, not moved), np.ones(count))


def _found(lattice: BoxLattice, pairs: PairTable, search: _Search, by: _Bent) -> Registration:
    samples, match = search.samples, search.match(lattice)
    bent = spread_out(search.bent(lattice), _MOST)
    middles = bent.mean(axis=1)
    gaps, beside = samples.gaps(middles, unit_normals(bent))
    frame = lattice.map.frame
    report = ScanReport(
        frame.to_model(samples.points),
        match.places.distance,
        match.counts,
        frame.to_model(middles),
        gaps,
        ~beside,
        search.reach,
        search.tolerance,
        by.rounds,
        by.smooth,
    )
    return Registration(lattice, pairs, report)
