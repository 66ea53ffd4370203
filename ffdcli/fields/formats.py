"""Extensions of files that fields are read from."""

# Mesh formats, as meshio names them.
MESH_FORMATS = {
    ".vtu": "vtu",
    ".vtk": "vtk",
    ".xdmf": "xdmf",
    ".xmf": "xdmf",
    ".inp": "abaqus",
    ".msh": "ansys",
    ".bdf": "nastran",
    ".nas": "nastran",
    ".fem": "nastran",
}
FIELD_SUFFIXES = (".csv", ".npz", *MESH_FORMATS)
