"""CAD parts of every kind of surface, made with cadquery, and their files."""

from pathlib import Path

import cadquery as cq
import numpy as np


def plate():
    """A plate with rounded corners, two holes, and a boss with a filleted rim."""
    body = cq.Workplane().box(40, 20, 4).edges("|Z").fillet(3)
    body = body.faces(">Z").workplane().pushPoints([(-13, 0), (13, 0)]).hole(5)
    body = body.faces(">Z").workplane().circle(5).extrude(6)
    return body.faces(">Z").edges().fillet(1).val()


def loft():
    """A loft between a square and two circles: B-spline sides."""
    start = cq.Workplane().rect(10, 8).workplane(offset=6).circle(4)
    return start.workplane(offset=5).circle(3).loft(combine=True).val()


def sweep():
    """A circle swept along a spline."""
    path = cq.Workplane("XZ").spline([(0, 0), (3, 6), (0, 12), (4, 18)])
    return cq.Workplane("XY").circle(1.5).sweep(path).val()


def revolution():
    """A spline turned about an axis, closed by planes."""
    profile = cq.Workplane("XZ").lineTo(3, 0).spline([(4, 3), (2, 6), (3, 9)], includeCurrent=True)
    return profile.lineTo(0, 9).close().revolve(360, (0, 0), (0, 1)).val()


def extrusion():
    """A closed spline, extruded."""
    points = [(4, 0), (2, 3), (-2, 3), (-4, 0), (-1, -2)]
    return cq.Workplane().spline(points, periodic=True).close().extrude(5).val()


def offset():
    """A wavy surface and another at a distance from it, closed to a solid."""
    grid = [
        [cq.Vector(x, y, 0.5 * np.sin(x) * np.cos(y)) for y in np.linspace(0, 4, 5)]
        for x in np.linspace(0, 6, 7)
    ]
    return cq.Face.makeSplineApprox(grid, tol=1e-4).thicken(1.0)


def hollow():
    """A box with a spherical cavity."""
    return cq.Workplane().box(10, 8, 6).cut(cq.Workplane().sphere(2)).val()


def nut():
    """A hexagon nut, chamfered by a cone: its sides are bounded by hyperbolas."""
    blank = cq.Workplane().polygon(6, 10).extrude(5).faces(">Z").workplane().hole(4)
    chamfer = cq.Workplane("XZ").polyline([(0, -4), (8, -4), (8, 1.2), (4.2, 5), (0, 5)]).close()
    return blank.intersect(chamfer.revolve(360, (0, 0), (0, 1))).val()


def pair():
    """Two solids: a box and a wedge-cut cylinder beside it."""
    box = cq.Workplane().box(4, 4, 4).val()
    rod = cq.Workplane().center(8, 0).circle(2).extrude(4).val()
    return cq.Compound.makeCompound([box, rod])


PARTS = {
    "plate": plate,
    "cylinder": lambda: cq.Solid.makeCylinder(3, 10),
    "frustum": lambda: cq.Solid.makeCone(4, 2, 6),
    "cone": lambda: cq.Solid.makeCone(3, 0, 5),
    "sphere": lambda: cq.Solid.makeSphere(3, angleDegrees1=-90, angleDegrees2=90),
    "torus": lambda: cq.Solid.makeTorus(5, 1.5),
    "loft": loft,
    "sweep": sweep,
    "revolution": revolution,
    "extrusion": extrusion,
    "offset": offset,
    "hollow": hollow,
    "nut": nut,
    "pair": pair,
}


def assembly():
    """A base, and a pin that stands at three places, with names and colours."""
    pin = cq.Workplane().circle(1).extrude(6).faces(">Z").edges().fillet(0.4)
    base = cq.Workplane().box(30, 10, 2)
    whole = cq.Assembly(base, name="base", color=cq.Color(0.2, 0.4, 0.6))
    for number, x in enumerate((-10, 0, 10)):
        turned = cq.Location(cq.Vector(x, 0, 1), cq.Vector(0, 0, 1), 15 * number)
        whole.add(pin, name=f"pin-{number}", loc=turned, color=cq.Color(0.8, 0.1, 0.1))
    return whole


def write_loose_block(folder: Path, gap: float) -> Path:
    """A BREP file of a block with a round edge, one vertex off the ends of its edges by a gap.

    The vertex is moved inwards along a diagonal of the block. All is within tolerances.
    """
    from OCP.BRep import BRep_Builder
    from OCP.gp import gp_Pnt

    block = cq.Workplane().box(6, 4, 2).edges("<X and |Z").fillet(1).val()
    corner = max(block.Vertices(), key=lambda vertex: sum(vertex.toTuple()))
    moved = np.subtract(corner.toTuple(), gap / np.sqrt(3))
    BRep_Builder().UpdateVertex(corner.wrapped, gp_Pnt(*moved.tolist()), 1.1 * gap)
    path = folder / "loose.brep"
    block.exportBrep(str(path))
    return path


def write_part(name: str, folder: Path, extension: str = ".step") -> Path:
    """Write a part of :data:`PARTS` with cadquery's own writers: its file."""
    path = folder / f"{name}{extension}"
    shape = PARTS[name]()
    if extension == ".brep":
        shape.exportBrep(str(path))
    elif extension == ".step":
        cq.exporters.export(cq.Workplane(shape), str(path))
    else:
        from OCP.IGESControl import IGESControl_Writer

        writer = IGESControl_Writer("MM", 1)
        writer.AddShape(shape.wrapped)
        writer.ComputeModel()
        writer.Write(str(path))
    return path
