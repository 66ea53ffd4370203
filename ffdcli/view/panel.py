"""Panels: what a PNG shows, as plain arrays; ffdcli.view.draw turns them into pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints


@dataclass(frozen=True)
class Triangles:
    """A surface in triangles.

    Parameters
    ----------
    points : (n, 3) float64
    triangles : (T, 3) int64
    colours : (T, 3) float64
        Red, green and blue from 0 to 1 of each triangle.
    smooth : bool
        Smooth shading instead of flat triangles.
    even : bool
        Even lighting, so that colours can be compared with a scale.
    """

    points: Floats
    triangles: Ints
    colours: Floats
    smooth: bool
    even: bool = False


@dataclass(frozen=True)
class Strokes:
    """Line segments (m, 2, 3) of one colour, with a width in pixels and an opacity up to 1."""

    segments: Floats
    colour: str
    width: float
    opacity: float = 1.0


@dataclass(frozen=True)
class Balls:
    """Points (n, 3), drawn as balls with a radius in pixels."""

    points: Floats
    colour: str
    radius: float = 4.5


@dataclass(frozen=True)
class Arrows:
    """Arrows, given by their start and end (k, 2, 3)."""

    ends: Floats
    colour: str


@dataclass(frozen=True)
class Scale:
    """A colour bar.

    Parameters
    ----------
    colours : (n, 3) float64
        Colours from the lowest value to the highest.
    low, high : float
    title : str
    """

    colours: Floats
    low: float
    high: float
    title: str


Part = Triangles | Strokes | Balls | Arrows


@dataclass(frozen=True)
class Panel:
    """One view with a title under it."""

    title: str
    parts: tuple[Part, ...]
    scale: Scale | None = None

    @property
    def points(self) -> Floats:
        """Points of all parts, (n, 3)."""
        found = [np.zeros((0, 3))]
        for part in self.parts:
            match part:
                case Triangles(points=points) | Balls(points=points):
                    found.append(points)
                case Strokes(segments=ends) | Arrows(ends=ends):
                    found.append(ends.reshape(-1, 3))
        return np.concatenate(found)
