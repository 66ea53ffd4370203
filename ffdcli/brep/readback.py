"""A CAD file in plain arrays, nothing repaired: the record that verification and pictures read.

Independent of OpenCascade. Curve ranges, pcurves and broken loops are kept as found.
"""

from __future__ import annotations

from dataclasses import dataclass

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.record import Topology


@dataclass(frozen=True)
class Pcurves:
    """Curves in surface parameters that share a degree and a multiplicity pattern.

    Parameters
    ----------
    coedges : (m,) int64
        The coedges that use them, one curve each.
    degree : int
    knots : (m, nb) float64
        Distinct knots of each curve.
    mults : (nb,) int64
    poles : (m, n, 2 or 3) float64, surface parameters
        With 3 components homogeneous ``(wu, wv, w)``.
    """

    coedges: Ints
    degree: int
    knots: Floats
    mults: Ints
    poles: Floats


@dataclass(frozen=True)
class ReadBrep(Topology):
    """The faces, edges and vertices of a CAD file, nothing repaired.

    One vertex for each vertex object of the file, however close two may lie; loops, and solids,
    in the file's order, loops chained only if the file's are. A straight line is a curve of degree
    1 with knots ``edge_range`` and the two end points as poles. On a plane, parameters are lengths
    along ``x_axis`` and ``y_axis``. ``shell_closed`` is OpenCascade's own flag.

    Parameters
    ----------
    edge_range : (E, 2) float64
        Parameters of the 3D curve at the edge's start and end. Pcurves have the same parameter.
    pcurves : batches that together cover every coedge once.
        On planes computed from the 3D curve, if the file has none; on other surfaces a coedge
        may be missing where the file has none.
    face_tolerance : (F,) float64, model length
    """

    edge_range: Floats
    pcurves: tuple[Pcurves, ...]
    face_tolerance: Floats
