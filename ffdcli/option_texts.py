"""Help texts of the options that `ffd deform` and jobs files share."""

from __future__ import annotations

PATCHES = (
    "Surfaces to make: `merged`, one for each planar region of the mesh; `bezier`, one Bézier "
    "patch for each plane and knot box; or `paper`, the same patches in the frames and degrees of "
    "Feng 2002, interpolated as there. The others are composed, not interpolated: their degrees "
    "are lower and no digits are lost. Default: merged."
)
COPLANAR_DISTANCE = (
    "Distance within which vertices lie in the plane of their face, in model units; needs an "
    "angle. A larger one than the default moves faces off the mesh, as the report states. Default: "
    "1e-9 of the mesh size, or what the numbers of the mesh file can tell apart."
)
COPLANAR_ANGLE = (
    "Largest angle between a polygon and the plane of its face, in degrees, at most 30. Default: "
    "what the distance allows."
)
TOLERANCE = (
    "Reduce the number of control points. Surfaces stay within this distance of the exact result "
    "(certified), in model units. Default: no reduction. Of a CAD part with curved faces: the "
    "tolerance of the fit."
)
MAX_DEGREE = (
    "Highest degree of a reduced result; needs a tolerance. Knots are inserted where a lower "
    "degree requires them. Default: that of the target, if it has one."
)
FIT_TOLERANCE = (
    "For what is fitted, lattices (`embedding: inverse`) and curved faces of CAD parts: largest "
    "distance between the surfaces and the deformed model, in model units. Default: 1e-5 of its "
    "size."
)
UNIT = (
    "Unit of the numbers, stated in the file header. Default: the unit of the lattice file, else "
    "of the mesh file, else mm."
)
TARGET = (
    "Program that will read the file. It sets the defaults of the STEP schema, the IGES mode and "
    "the highest degree. Default: generic."
)
SCHEMA = "STEP application protocol. Default: that of the target (ap214)."
IGES_MODE = (
    "IGES entities to write: `brep`, solids (entity 186); or `faces`, trimmed surfaces (entity "
    "144). Default: that of the target."
)
WRITER = (
    "What makes the file: `kernel`, OpenCascade; or `direct`, for STEP: the same content, written "
    "straight from the arrays without OpenCascade, in a fraction of the time and memory. "
    "Default: kernel."
)
CHECKS = (
    "Checks that the result must pass before it is written: `own`, those of this program; or "
    "`kernel`, OpenCascade's too. Default: `own` with `--writer direct`, else `kernel`."
)
CHECK = (
    "Check the result before it is written: true; false; or as `--check`, `own` or `kernel`. "
    "Default: true, which is `own` with the writer `direct`, else `kernel`."
)
MEMORY = (
    "Memory that may be taken, such as 12GB; what is foreseen to take more is refused. `none`: no "
    "limit. Default: what is free, or what the variable FFD_MEMORY says."
)
REPAIR = "Repair faults of a mesh where this does not move its surface; CAD parts are refused."
REQUIRE_SOLID = "Reject a mesh that is not closed."
REQUIRE_INJECTIVE = (
    "Reject a lattice that folds the model over, or for which folding cannot be ruled out."
)
