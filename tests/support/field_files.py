"""Small mesh files with displacements, as text of the tests' own, and points of them."""

import base64
import io

import numpy as np

# Two tetrahedra on a face, and where their nodes go.
POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1.5, 1, 1.25]], dtype=float)
MOVES = np.array([[0, 0, 0], [0.125, 0, 0], [0, 0.25, 0], [0, 0, -0.5], [1, 2, 3]], dtype=float)
CELLS = [[0, 1, 2, 3], [1, 2, 3, 4]]


def rows(values, between=" "):
    return "\n".join(between.join(map(repr, np.atleast_1d(row).tolist())) for row in values)


def vtu(arrays, points=POINTS, binary=False):
    """A .vtu file with arrays at nodes: name and values of each."""

    def array(values, kind, name):
        components = np.shape(values)[1] if np.ndim(values) > 1 else 1
        text, form = rows(np.reshape(values, (-1, components))), "ascii"
        if binary:
            data = np.ascontiguousarray(values, dtype=kind.lower()).tobytes()
            text = base64.b64encode(np.uint32(len(data)).tobytes() + data).decode()
            form = "binary"
        return (
            f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" '
            f'format="{form}">{text}</DataArray>\n'
        )

    data = "".join(array(values, "Float64", name) for name, values in arrays)
    cells = (
        array(np.ravel(CELLS), "Int64", "connectivity")
        + array(np.array([4, 8]), "Int64", "offsets")
        + array(np.array([10, 10]), "UInt8", "types")
    ).replace(' NumberOfComponents="1"', "")
    return (
        '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" '
        'byte_order="LittleEndian">\n<UnstructuredGrid>\n'
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="2">\n'
        f"<PointData>{data}</PointData>\n<Points>{array(points, 'Float64', 'Points')}</Points>\n"
        f"<Cells>{cells}</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
    ).encode()


def vtk(name="U", moves=MOVES, points=POINTS):
    """A legacy .vtk file of version 3.0."""
    cells = "".join(f"4 {' '.join(map(str, cell))}\n" for cell in CELLS)
    return (
        "# vtk DataFile Version 3.0\na result\nASCII\nDATASET UNSTRUCTURED_GRID\n"
        f"POINTS {len(points)} double\n{rows(points)}\nCELLS 2 10\n{cells}"
        f"CELL_TYPES 2\n10\n10\nPOINT_DATA {len(points)}\nVECTORS {name} double\n{rows(moves)}\n"
    ).encode()


def item(values, text=None, form="XML"):
    """A data item of an XDMF file."""
    values = np.asarray(values)
    kind = "Int" if values.dtype.kind == "i" else "Float"
    return (
        f'<DataItem DataType="{kind}" Precision="8" Format="{form}" '
        f'Dimensions="{" ".join(map(str, values.shape))}">{text or rows(values)}</DataItem>'
    )


def xdmf_mesh(points=None):
    return (
        f'<Geometry GeometryType="XYZ">{points or item(POINTS)}</Geometry>\n'
        '<Topology TopologyType="Tetrahedron" NumberOfElements="2">'
        f"{item(np.array(CELLS))}</Topology>\n"
    )


def xdmf_field(moves=None, name="U"):
    return f'<Attribute Name="{name}" Center="Node">{moves or item(MOVES)}</Attribute>\n'


def xdmf(inside=None):
    inside = inside or (f'<Grid Name="g" GridType="Uniform">\n{xdmf_mesh()}{xdmf_field()}</Grid>\n')
    return f'<Xdmf Version="3.0"><Domain>\n{inside}</Domain></Xdmf>\n'.encode()


def xdmf_series(*steps):
    """An XDMF file of several times, with the mesh in the first."""
    grids = "".join(
        f'<Grid Name="g" GridType="Uniform"><Time Value="{n}"/>\n{step}</Grid>\n'
        for n, step in enumerate(steps)
    )
    return xdmf(f'<Grid GridType="Collection" CollectionType="Temporal">\n{grids}</Grid>\n')


def abaqus(points=POINTS, numbers=(11, 12, 20, 21, 30), before="", after=""):
    nodes = "".join(
        f"{number}, {', '.join(map(repr, point))}\n"
        for number, point in zip(numbers, points.tolist(), strict=True)
    )
    cells = "".join(
        f"{n}, {', '.join(str(numbers[node]) for node in cell)}\n" for n, cell in enumerate(CELLS)
    )
    return (
        f"*Heading\n a model\n** a comment\n{before}*Node, nset=all\n{nodes}"
        f"*Element, type=C3D4\n{cells}{after}*Step\n*Node Output\nU\n*End Step\n"
    ).encode()


def nastran(points=POINTS, system="", before=""):
    nodes = "".join(
        f"GRID    {n:<8d}{system:<8s}{x:8.4f}{y:8.4f}{z:8.4f}\n"
        for n, (x, y, z) in enumerate(points.tolist(), start=101)
    )
    cells = "".join(
        f"CTETRA  {n:<8d}{1:<8d}{''.join(f'{node + 101:<8d}' for node in cell)}\n"
        for n, cell in enumerate(CELLS, start=1)
    )
    return f"SOL 101\nCEND\nBEGIN BULK\n{before}{nodes}{cells}ENDDATA\n".encode()


def ansys(points=POINTS, declared=None):
    count = len(points) if declared is None else declared
    cells = "".join(f"{' '.join(f'{node + 1:x}' for node in cell)}\n" for cell in CELLS)
    return (
        f'(0 "a mesh")\n(2 3)\n(10 (0 1 {count:x} 0))\n(12 (0 1 2 0))\n'
        f"(10 (1 1 {len(points):x} 1 3)(\n{rows(points)}\n))\n(12 (2 1 2 1 2)(\n{cells}))\n"
    ).encode()


def npz(**arrays):
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


FORMATS = {
    "f.vtu": (vtu([("U", MOVES)]), vtu([], POINTS + MOVES)),
    "f.vtk": (vtk(), vtk(points=POINTS + MOVES)),
    "f.xdmf": (
        xdmf(),
        xdmf(f'<Grid GridType="Uniform">{xdmf_mesh(item(POINTS + MOVES))}</Grid>'),
    ),
    "f.inp": (abaqus(), abaqus(POINTS + MOVES)),
    "f.bdf": (nastran(), nastran(POINTS + MOVES)),
    "f.msh": (ansys(), ansys(POINTS + MOVES)),
}
