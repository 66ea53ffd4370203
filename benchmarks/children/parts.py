"""Two CAD parts made with cadquery: a small plate with features of many kinds, and a large one.

Given the numbers of columns and rows of pockets of the large one, its name, and that of the small
one.
"""

import sys

import cadquery as cq

PITCH = 20.0


def small():
    """A plate with two holes, a boss with a filleted rim, a sphere, a torus bead: 19 faces."""
    body = cq.Workplane().box(80, 50, 8).edges("|Z").fillet(6)
    body = body.faces(">Z").workplane().pushPoints([(-30, 15), (30, -15)]).hole(8)
    boss = cq.Workplane().workplane(offset=4).center(-18, -8).circle(9).extrude(10)
    body = body.union(boss.faces(">Z").edges().fillet(2.5))
    body = body.union(cq.Workplane().sphere(7).translate((16, 8, 5)))
    bead = cq.Workplane("XZ").center(9, 0).circle(2).revolve(120, (-9, 0, 0), (-9, 1, 0))
    return body.union(bead.translate((14, -10, 4))).val()


def large(columns, rows):
    """A plate with filleted pockets of 17 faces each, and holes between them."""
    plate = cq.Workplane().box(columns * PITCH, rows * PITCH, 10).val()
    pocket = cq.Workplane().rect(12, 10).extrude(12).edges("|Z").fillet(3)
    pocket = pocket.faces("<Z").edges().fillet(1).val()
    drill = cq.Workplane().circle(1.5).extrude(30).val()
    across = [(number - (columns - 1) / 2) * PITCH for number in range(columns)]
    along = [(number - (rows - 1) / 2) * PITCH for number in range(rows)]
    pockets = [pocket.moved(cq.Location(cq.Vector(x, y, -1))) for x in across for y in along]
    drills = [
        drill.moved(cq.Location(cq.Vector(x + PITCH / 2, y + PITCH / 2, -15)))
        for x in across[:-1]
        for y in along[:-1]
    ]
    return plate.cut(*pockets, *drills).Solids()[0]


columns, rows, large_file, small_file = sys.argv[1:]
large(int(columns), int(rows)).exportStep(large_file)
small().exportStep(small_file)
