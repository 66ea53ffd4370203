"""Weighted T-spline lattices at the sizes of Song & Yang (2005), Table 1.

Control points by octree beside those by regular subdivision, and the time to find the parameters of
all points, octree and index included; against nonlinear conjugate gradients (scipy) called point by
point, as in the paper, with analytic gradients and to the same residual, in the same run.

    python benchmarks/tspline.py [--points 14737] [--sample 25]

The paper's models are not published: a small tree takes their place, resampled to their counts.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

from ffdcli.lattice.layout import padding
from ffdcli.volume.adaptive.octree_growth import grow
from ffdcli.volume.adaptive.parameters import SOLVED, find_parameters
from ffdcli.volume.adaptive.tspline import tspline_volume
from ffdcli.volume.adaptive.volume import AdaptiveVolume
from ffdcli.volume.frame import Frame

sys.path.insert(0, str(Path(__file__).parent.parent / "samples"))
from make_octree_samples import tree as tree_field
from make_samples import surface_net

Floats = Any


def model(count: int) -> Floats:
    """Points (count, 3) on a tree, and its triangles (T, 3, 3)."""
    low, high = np.array([-66.0, -52.0, -20.0]), np.array([76.0, 40.0, 132.0])
    step = 2.0 * (9000 / count) ** 0.5
    while True:
        vertices, triangles = surface_net(tree_field, low, high, step)
        if len(vertices) >= count:
            return vertices[:count], vertices[triangles]
        step *= 0.97


def build(points: Floats, triangles: Floats, depth: int, rule: str) -> AdaptiveVolume:
    """The volume at rest; its box is padded by a finest cell."""
    low, high = points.min(axis=0), points.max(axis=0)
    more = padding(high - low, 0.5**depth)
    box = np.stack([low - more, high + more])
    surface = rule == "surface"
    tree = grow(
        (triangles - box[0]) / (box[1] - box[0]) if surface else None,
        None if surface else (points - box[0]) / (box[1] - box[0]),
        depth,
    )
    return tspline_volume(tree, box, (100.0, 1.0), Frame(np.zeros(3), np.eye(3)))


class Single:
    """The map at rest and its derivatives at one point, kept as lean as numpy allows."""

    def __init__(self, volume: AdaptiveVolume) -> None:
        self.rest = volume.plain_map(volume.rest_points, volume.rest_weights)
        self.tree = volume.functions.tree
        self.forms: dict[int, Floats] = {}
        self.calls = 0

    def __call__(self, at: Floats) -> tuple[Floats, Floats]:
        """Image (3,) and derivatives (3, 3) at a point (3,)."""
        self.calls += 1
        rest, tree = self.rest, self.tree
        units = (at - rest.origin) / rest.unit
        cell = np.clip(units, 0, (1 << tree.depth) - 1).astype(np.int64)
        leaf = int(tree.locate(cell[None])[0])
        if leaf not in self.forms:
            self.forms[leaf] = rest._forms(np.array([leaf]))[0]
        size = tree.size[leaf]
        x = (units - tree.low[leaf] - size / 2) * 2 / size
        scale = 2 / (size * rest.unit)
        ones = np.ones(3)
        value = np.stack([ones, x, 2 * x * x - 1, 4 * x**3 - 3 * x])
        slope = np.stack([0 * ones, ones, 4 * x, 12 * x * x - 3]) * scale
        form = self.forms[leaf]
        w = form.transpose(0, 1, 3, 2) @ np.stack([value[:, 2], slope[:, 2]], axis=1)
        v = np.einsum("ijcs,jt->icst", w, np.stack([value[:, 1], slope[:, 1]], axis=1))
        u = np.einsum("icst,ir->cstr", v, np.stack([value[:, 0], slope[:, 0]], axis=1))
        n, d = u[:, 0, 0, 0], np.stack([u[:, 0, 0, 1], u[:, 0, 1, 0], u[:, 1, 0, 0]], axis=1)
        image = n[:3] / n[3]
        return image, (d[:3] - image[:, None] * d[3]) / n[3]


def conjugate_gradients(single: Single, point: Floats, enough: float) -> float:
    """Residual that conjugate gradients reach from the point itself, restarted while they help."""

    def target(at: Floats) -> tuple[float, Floats]:
        image, slopes = single(at)
        gap = image - point
        return float(gap @ gap), 2 * slopes.T @ gap

    at, residual = point, np.inf
    for _ in range(10):
        found = minimize(target, at, jac=True, method="CG", options={"gtol": 1e-14})
        before, residual = residual, float(np.sqrt(found.fun))
        at = found.x
        if residual <= enough or residual >= before:
            break
    return residual


def main() -> None:
    """Print the table, then the comparison at the largest size and depth 5."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, nargs="*", default=[8738, 9555, 14737])
    parser.add_argument("--sample", type=int, default=25, help="points for conjugate gradients")
    options = parser.parse_args()
    print("points  rule      depth  control points  regular  exposed  octree+index   solve  worst")
    timed: dict[str, float] = {}
    for count in options.points:
        points, triangles = model(count)
        for rule in ("vertices", "surface"):
            for depth in (3, 4, 5):
                begin = time.perf_counter()
                volume = build(points, triangles, depth, rule)
                built = time.perf_counter()
                found = find_parameters(volume, points)
                done = time.perf_counter()
                size = float(np.linalg.norm(volume.box[1] - volume.box[0]))
                print(
                    f"{count:6}  {rule:8}  {depth:5}  {volume.shape[0]:14}  {(2**depth + 1) ** 3:7}"
                    f"  {int((~volume.hidden).sum()):7}  {built - begin:10.2f} s  "
                    f"{done - built:4.2f} s  {found.residual.max() / size:.1e} "
                    f"unsolved {int((~found.solved).sum())} folded {int(found.folded.sum())}",
                    flush=True,
                )
                timed[rule] = (done - begin) / count
    single = Single(volume)
    chosen = np.random.default_rng(0).choice(len(points), options.sample, replace=False)
    enough = SOLVED * float(np.linalg.norm(volume.box[1] - volume.box[0]))
    # The forms of all cells that the points' own paths meet are there before the clock starts.
    for i in chosen:
        conjugate_gradients(single, points[i], enough)
    single.calls = 0
    begin = time.perf_counter()
    residuals = np.array([conjugate_gradients(single, points[i], enough) for i in chosen])
    each = (time.perf_counter() - begin) / len(chosen)
    print(
        f"conjugate gradients, depth 5: {1e3 * each:.2f} ms a point, "
        f"{single.calls / len(chosen):.0f} evaluations; "
        f"{int((residuals <= enough).sum())} of {len(chosen)} reach the residual"
    )
    for rule, ours in timed.items():
        print(
            f"all at once, octree ({rule}) and index included: {1e3 * ours:.4f} ms a point: "
            f"{each / ours:.0f} times as fast"
        )


if __name__ == "__main__":
    main()
