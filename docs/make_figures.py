"""Draw the figures of the design page again: `python docs/make_figures.py` (needs matplotlib)."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from scipy.interpolate import BSpline

matplotlib.use("svg")
import itertools

from matplotlib import pyplot as plt

FOLDER = Path(__file__).parent / "figures"
BLUE, RED, GREY = "#2060a0", "#c04020", "#888888"
# Text stays text and ids stay the same, so that files are small and change only with the figure.
plt.rcParams.update(
    {
        "svg.fonttype": "none",
        "svg.hashsalt": "ffdcli",
        "font.family": "sans-serif",
        "font.size": 9,
        "axes.spines.top": False,
        "axes.spines.right": False,
    }
)


def basis(knots: np.ndarray, degree: int, at: np.ndarray) -> np.ndarray:
    """Values of all B-splines at parameters."""
    return BSpline.design_matrix(at, knots, degree).toarray()


def clamped(count: int, degree: int) -> np.ndarray:
    """Clamped knots over 0..1, evenly spaced."""
    inner = np.linspace(0, 1, count - degree + 1)
    return np.r_[[0] * degree, inner, [1] * degree]


def identity():
    """Control points at the Greville abscissae make the volume at rest the identity."""
    degree, count = 3, 6
    knots, at = clamped(count, degree), np.linspace(0, 1 - 1e-12, 300)
    greville = np.array([knots[i + 1 : i + degree + 1].mean() for i in range(count)])
    even = np.linspace(0, 1, count)
    figure, axes = plt.subplots(1, 2, figsize=(7, 2.9))
    for axis, points, title, colour in (
        (axes[0], even, "control points evenly spaced", RED),
        (axes[1], greville, "control points at the Greville abscissae", BLUE),
    ):
        axis.plot([0, 1], [0, 1], color=GREY, lw=0.8, ls="--")
        axis.plot(at, basis(knots, degree, at) @ points, color=colour)
        axis.plot(np.zeros(count), points, "o", color=colour, ms=4, clip_on=False)
        axis.set(title=title, xlabel="coordinate u", ylabel="image of u", aspect="equal")
    return figure


def cuts():
    """A region that slopes along both other axes: cuts of the paper, and cuts here."""
    figure, axes = plt.subplots(1, 2, figsize=(7, 3.2))
    inner = (1 / 3, 2 / 3)
    for axis, title in zip(
        axes,
        ("Feng et al.: 19 pieces, degree 6 × 9", "here: 3 surfaces, degree 6 × 6"),
        strict=True,
    ):
        here = axis is axes[1]
        for knot in inner:
            axis.axvline(knot, color=GREY if here else RED, lw=1, ls=":" if here else "-")
            axis.axhline(knot, color=GREY if here else RED, lw=1, ls=":" if here else "-")
        b = np.linspace(0, 1, 2)
        for level in (0.75, 1.25):
            axis.plot(b, level - b, color=RED, lw=1.6)
        axis.set(title=title, xlim=(0, 1), ylim=(0, 1), aspect="equal")
        axis.set(xlabel="$u_b$", ylabel="$u_c$", xticks=inner, yticks=inner)
        axis.set_xticklabels(["knot", "knot"])
        axis.set_yticklabels(["knot", "knot"])
    return figure


def overshoot():
    """A long strip: its rectangle leaves the slab, until the strip is cut."""
    figure, axes = plt.subplots(1, 2, figsize=(7, 3.2), sharey=True)
    for axis, parts, title in (
        (axes[0], 1, "one rectangle reaches far out of the slab"),
        (axes[1], 4, "cut in four: each stays near the slab"),
    ):
        ends = np.linspace(0.05, 0.95, parts + 1)
        half = 0.035
        for low, high in itertools.pairwise(ends):
            axis.fill([low, low, high, high], [low - half, low + half, high + half, high - half],
                      color=BLUE, alpha=0.5, lw=0)  # fmt: skip
            axis.add_patch(plt.Rectangle((low, low - half), high - low, high - low + 2 * half,
                                         fill=False, ec=GREY, lw=1))  # fmt: skip
        for shift in (-0.14, 0.14):
            axis.plot([0, 1], [shift, 1 + shift], color=RED, lw=1)
        axis.set(title=title, xlim=(0, 1), ylim=(0, 1), aspect="equal")
        axis.set(xlabel="$u_b$", ylabel="$u_c$", xticks=[], yticks=[])
    axes[0].annotate("knot planes of\nthe dominant axis", (0.3, 0.44), (0.04, 0.8), color=RED,
                     arrowprops={"arrowstyle": "-", "color": RED, "lw": 0.6})  # fmt: skip
    return figure


def drag():
    """The least move of control points that takes a point to its target, and what it does."""
    figure, axis = plt.subplots(figsize=(7, 2.6))
    at, place = np.linspace(0, 1 - 1e-12, 400), 0.45
    for count, colour in ((6, BLUE), (10, "#208060"), (16, RED)):
        knots = clamped(count, 3)
        row = basis(knots, 3, np.array([place]))[0]
        axis.plot(at, basis(knots, 3, at) @ (row / (row @ row)), color=colour,
                  label=f"{count} control points")  # fmt: skip
    axis.plot([place], [1], "o", color="black", ms=4)
    axis.annotate("dragged point: met exactly", (place, 1), (0.55, 0.95))
    axis.set(xlabel="place along the object", ylabel="displacement", xlim=(0, 1))
    axis.legend(frameon=False, loc="upper left")
    return figure


def _cells(curve: np.ndarray, depth: int) -> list[tuple[float, float, float]]:
    """Leaves (x, y, side) of a balanced quadtree round a curve."""
    leaves = [(0.0, 0.0, 1.0)]
    while True:
        split = [cell for cell in leaves if _is_split(cell, leaves, curve, depth)]
        if not split:
            return leaves
        leaves = [cell for cell in leaves if cell not in split] + [
            (x + i * side / 2, y + j * side / 2, side / 2)
            for x, y, side in split
            for i in (0, 1)
            for j in (0, 1)
        ]


def _is_split(cell, leaves, curve, depth) -> bool:
    side = cell[2]
    small = any(other[2] < side / 2 and _touch(cell, other) for other in leaves)
    return small or (_holds(cell, curve) and side > 0.5**depth)


def _touch(one, other) -> bool:
    return all(one[i] <= other[i] + other[2] and other[i] <= one[i] + one[2] for i in (0, 1))


def _holds(cell, curve: np.ndarray) -> bool:
    low = np.array(cell[:2])
    return bool(((curve >= low) & (curve <= low + cell[2])).all(axis=1).any())


def octree():
    """A quadtree round a curve; corners of cells that hold it are heavy, the others hidden."""
    angle = np.linspace(0, 2 * np.pi, 2000)
    curve = np.column_stack([0.42 + 0.26 * np.cos(angle), 0.46 + 0.2 * np.sin(angle)])
    figure, axis = plt.subplots(figsize=(4.2, 4.2))
    heavy, every = set(), set()
    for x, y, side in _cells(curve, 4):
        axis.add_patch(plt.Rectangle((x, y), side, side, fill=False, ec=GREY, lw=0.6))
        corners = {(x, y), (x + side, y), (x, y + side), (x + side, y + side)}
        every |= corners
        heavy |= corners if _holds((x, y, side), curve) else set()
    axis.plot(*curve.T, color=BLUE, lw=1.5)
    for points, style in ((every - heavy, {"mfc": "white"}), (heavy, {"mfc": RED})):
        axis.plot(*np.array(sorted(points)).T, "o", mec=RED, ms=3.5, mew=0.7, **style)
    axis.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), aspect="equal", xticks=[], yticks=[])
    axis.spines[:].set_visible(False)
    return figure


def hull():
    """The hull of a difference's control points bounds it; after two halvings it is tight."""
    figure, axes = plt.subplots(1, 2, figsize=(7, 2.4), sharey=True)
    points = np.array([0.0, 0.9, -1.1, 1.0, -0.8, 0.7, 0.0])
    at = np.linspace(0, 1, 400)
    for axis, cells, title in ((axes[0], 1, "control points"), (axes[1], 4, "after two halvings")):
        bounds = np.linspace(0, 1, cells + 1)
        value = _bernstein(points)
        for low, high in itertools.pairwise(bounds):
            part = _restricted(points, low, high)
            axis.plot(np.linspace(low, high, len(part)), part, "o--", color=RED, ms=3, lw=0.7)
        axis.plot(at, value(at), color=BLUE)
        axis.axhline(0, color=GREY, lw=0.5)
        axis.set(title=title, xlabel="parameter", ylabel="difference" if axis is axes[0] else "")
    return figure


def _bernstein(points: np.ndarray) -> BSpline:
    degree = len(points) - 1
    return BSpline(np.r_[[0.0] * (degree + 1), [1.0] * (degree + 1)], points, degree)


def _restricted(points: np.ndarray, low: float, high: float) -> np.ndarray:
    """Control points of the same polynomial on a part of its range, by blossoming."""
    degree = len(points) - 1
    out = []
    for index in range(degree + 1):
        values = points.copy()
        for argument in [high] * index + [low] * (degree - index):
            values = (1 - argument) * values[:-1] + argument * values[1:]
        out.append(values[0])
    return np.array(out)


FIGURES = {
    "identity": identity,
    "cuts": cuts,
    "overshoot": overshoot,
    "hull": hull,
    "drag": drag,
    "octree": octree,
}


def main() -> None:
    """Draw all figures."""
    FOLDER.mkdir(exist_ok=True)
    for name, make in FIGURES.items():
        figure = make()
        figure.tight_layout()
        figure.savefig(FOLDER / f"{name}.svg", metadata={"Date": None})
        plt.close(figure)


if __name__ == "__main__":
    main()
