"""Make the CAD sample again: `python samples/make_cad_samples.py [FOLDER]`.

A bracket for a wall: a plate with four screw holes, an arm with a rib, and at its end a seat with a
bore; corners, the root of the arm and the rim of the seat have fillets. The faces `wall` and `seat`
have names, which lattice files use as groups.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cadquery as cq

Box = cq.selectors.BoxSelector


def make_bracket() -> cq.Workplane:
    """Plate 10 x 70 x 80 mm, its back at x = 0; arm along x; seat at x = 105, its top at z = 24."""
    plate = cq.Workplane("YZ").rect(70, 80).extrude(10).edges("|X").fillet(10)
    arm = cq.Workplane().box(95, 30, 12, centered=(False, True, True)).translate((10, 0, 6))
    arm = arm.edges("|X").fillet(3)
    seat = cq.Workplane().center(105, 0).circle(19).extrude(24)
    rib = cq.Workplane("XZ").polyline([(8, -34), (8, 2), (80, 2)]).close().extrude(4, both=True)
    body = plate.union(arm).union(seat).union(rib)
    body = body.edges(Box((9, -16, -1), (11, 16, 13))).fillet(4)
    body = body.edges(Box((80, -25, 23), (130, 25, 25))).fillet(2)
    body = body.faces(">Z[-1]").workplane(origin=(105, 0, 24)).hole(18)
    holes = [(y, z) for y in (-25, 25) for z in (-28, 28)]
    return body.faces("<X").workplane(origin=(0, 0, 0)).pushPoints(holes).hole(8)


def main(folder: Path) -> None:
    """Write the bracket as STEP, with names of two faces and colours."""
    body = make_bracket()
    whole = cq.Assembly(name="bracket")
    whole.add(body, name="body", color=cq.Color(0.55, 0.6, 0.66))
    (part,) = whole.children
    part.addSubshape(body.faces("<X").val(), name="wall")
    top = body.faces(cq.NearestToPointSelector((90, 0, 24))).val()
    part.addSubshape(top, name="seat", color=cq.Color(0.85, 0.45, 0.1))
    (folder / "cad").mkdir(exist_ok=True)
    whole.export(str(folder / "cad" / "bracket.step"))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
