"""Fields in mesh files: right, or refused by name, never less than the file says."""

import os
import subprocess
import sys

import numpy as np
import pytest

from ffdcli.errors import FileError
from ffdcli.fields import mesh_files
from ffdcli.fields.read import read_field
from support.field_files import (
    CELLS,
    FORMATS,
    MOVES,
    POINTS,
    abaqus,
    ansys,
    item,
    nastran,
    vtk,
    vtu,
    xdmf,
    xdmf_field,
    xdmf_mesh,
    xdmf_series,
)

pytest.importorskip("meshio")
pytest.importorskip("h5py")
WITH_RESULTS = ("f.vtu", "f.vtk", "f.xdmf")


def put(folder, name, content):
    (folder / name).write_bytes(content)
    return folder / name


def refusal(path, **how):
    with pytest.raises(FileError) as caught:
        read_field(path, **how)
    assert caught.value.hint
    return str(caught.value)


@pytest.mark.parametrize("name", WITH_RESULTS)
def test_the_only_field_of_vectors_is_taken_and_said(tmp_path, name):
    field = read_field(put(tmp_path, name, FORMATS[name][0]))
    np.testing.assert_array_equal(field.sources, POINTS)
    np.testing.assert_array_equal(field.goals, MOVES)
    assert (field.by, field.name) == (True, "U")
    assert field.notes == (f"the field `U` of `{name}` is taken",)


@pytest.mark.parametrize("name", FORMATS)
def test_a_second_mesh_gives_the_targets(tmp_path, name):
    path = put(tmp_path, name, FORMATS[name][0])
    field = read_field(path, targets=put(tmp_path, f"moved-{name}", FORMATS[name][1]))
    np.testing.assert_array_equal(field.sources, POINTS)
    np.testing.assert_array_equal(field.goals, POINTS + MOVES)
    assert not field.by


@pytest.mark.parametrize("name", [name for name in FORMATS if name not in WITH_RESULTS])
@pytest.mark.parametrize("how", [{}, {"name": "U"}])
def test_formats_without_results_are_refused_by_name(tmp_path, name, how):
    said = refusal(put(tmp_path, name, FORMATS[name][0]), **how)
    assert "hold nodes and elements, and no displacements" in said
    assert "as `targets` the deformed mesh" in said


def test_several_fields_are_named_and_asked_for(tmp_path):
    arrays = [("U", MOVES), ("velocity", MOVES * 2), ("T", np.ones(5))]
    path = put(tmp_path, "f.vtu", vtu(arrays))
    assert "`U`, `velocity` (say which: `field: NAME`" in refusal(path)
    np.testing.assert_array_equal(read_field(path, name="velocity").goals, MOVES * 2)
    assert "there is no field of this name (fields" in refusal(path, name="u")
    assert "three numbers for each node: `U`, `velocity`)" in refusal(path, name="u")
    assert "`T`: it has the shape (5,)" in refusal(path, name="T").replace("(5, 1)", "(5,)")
    other = put(tmp_path, "g.vtu", vtu([]))
    assert "it holds no field of three numbers" in refusal(other)
    assert "both a field, `U`, and targets" in refusal(path, name="U", targets=other)


def test_names_with_blanks_in_legacy_files(tmp_path):
    path = put(tmp_path, "f.vtk", vtk("total%20displacement"))
    assert read_field(path).name == "total displacement"


def test_numbers_that_are_not_finite_are_refused(tmp_path):
    moves = MOVES.copy()
    moves[3, 1] = np.nan
    path = put(tmp_path, "f.vtu", vtu([("U", moves)], binary=True))
    assert "node 4 holds a number that is not finite" in refusal(path)


def test_files_of_vtk_itself(tmp_path):
    vtk_io = pytest.importorskip("vtkmodules.vtkIOXML")
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

    grid, points = vtkUnstructuredGrid(), vtkPoints()
    points.SetData(numpy_to_vtk(POINTS, deep=True))
    grid.SetPoints(points)
    for cell in CELLS:
        grid.InsertNextCell(10, 4, cell)
    moves = numpy_to_vtk(MOVES, deep=True)
    moves.SetName("Displacement")
    grid.GetPointData().AddArray(moves)
    for mode in ("Ascii", "Binary", "Appended"):
        writer = vtk_io.vtkXMLUnstructuredGridWriter()
        writer.SetFileName(str(tmp_path / "f.vtu"))
        writer.SetInputData(grid)
        getattr(writer, f"SetDataModeTo{mode}")()
        writer.EncodeAppendedDataOff()
        writer.Write()
        field = read_field(tmp_path / "f.vtu")
        np.testing.assert_array_equal(field.sources, POINTS)
        np.testing.assert_array_equal(field.goals, MOVES)
    writer.SetCompressorTypeToLZ4()
    writer.Write()
    assert "compressed with LZ4" in refusal(tmp_path / "f.vtu")


OTHER = POINTS[[1, 0, 2, 3, 4]] + MOVES


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        (abaqus(), abaqus(OTHER, (12, 11, 20, 21, 30)), "numbered otherwise"),
        (abaqus(), abaqus(numbers=(11, 12, 20, 21, 31)), "numbered otherwise"),
        (abaqus(), abaqus().replace(b"0, 11, 12, 20", b"0, 12, 11, 20"), "has other elements"),
    ],
)
def test_targets_are_those_of_the_same_mesh(tmp_path, first, second, words):
    path = put(tmp_path, "f.inp", first)
    assert words in refusal(path, targets=put(tmp_path, "g.inp", second))


def test_targets_of_another_mesh_or_format_are_refused(tmp_path):
    path = put(tmp_path, "f.vtu", vtu([]))
    fewer = put(tmp_path, "g.msh", ansys())
    assert "are of different formats" in refusal(path, targets=fewer)
    more = put(tmp_path, "g.vtu", vtu([], np.vstack([POINTS, POINTS[:1]])))
    assert "has 6 nodes, and `f.vtu` has 5" in refusal(path, targets=more)


def test_a_table_by_numbers_of_nodes(tmp_path):
    path = put(tmp_path, "f.inp", abaqus())
    numbers = [30, 11, 20]
    rows = "".join(f"{n},{x},{y},{z}\n" for n, (x, y, z) in zip(numbers, MOVES, strict=False))
    table = put(tmp_path, "u.csv", f"node,dx,dy,dz\n{rows}".encode())
    field = read_field(path, targets=table)
    np.testing.assert_array_equal(field.sources, POINTS[[4, 0, 2]])
    np.testing.assert_array_equal(field.goals, MOVES[:3])
    assert field.by
    assert field.notes == ("`u.csv` moves 3 nodes; 2 others are left out",)
    put(tmp_path, "u.csv", f"Node, TX, TY, TZ\n{rows}".encode())
    assert not read_field(path, targets=table).by


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("11,0,0,0\n13,0,0,1\n", "row 2 is for node 13, which `f.inp` does not have"),
        ("99,0,0,0\n", "row 1 is for node 99"),
        ("11.5,0,0,0\n", "row 1 is for node 11.5"),
        ("nan,0,0,0\n", "row 1 is for node nan"),
        ("11,0,0,0\n11,0,0,1\n", "node 11 is given twice"),
        ("11,0,0\n", "row 2 is not four numbers"),
        ("11,0,0,inf\n", "row 1 holds a number that is not finite"),
        ("", "the file holds no rows"),
    ],
)
def test_wrong_tables_by_numbers_are_refused(tmp_path, rows, words):
    path = put(tmp_path, "f.inp", abaqus())
    table = put(tmp_path, "u.csv", f"node,dx,dy,dz\n{rows}".encode())
    assert words in refusal(path, targets=table)
    other = put(tmp_path, "f.vtu", vtu([]))
    assert "`f.vtu` does not number its nodes" in refusal(other, targets=table)


INSTANCE = "*Instance, name=a, part=b\n{}*End Instance\n"


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("f.inp", abaqus(before="*Node\n1, 0., 0., 0.\n"), "a second block *NODE begins"),
        ("f.inp", abaqus(before="*Include, input=/etc/passwd\n"), "another file is included"),
        ("f.inp", abaqus(after="*Ngen\n11, 12, 1\n"), "nodes are generated (*NGEN)"),
        ("f.inp", abaqus().replace(b"nset=all", b"system=C"), "*NODE with SYSTEM=C"),
        ("f.inp", abaqus(after=INSTANCE.format("1., 0., 0.\n")), "an instance is moved"),
        ("f.inp", abaqus(numbers=(11, 11, 20, 21, 30)), "node 11 is given twice"),
        ("f.inp", abaqus(POINTS[:, :2]), "have the shape (5, 2)"),
        ("f.inp", abaqus().replace(b"30, 1.5", b"x, 1.5"), "'x' is no number of a node"),
        ("f.bdf", nastran(system="4"), "node 101 is in the coordinate system 4"),
        ("f.bdf", nastran(before="INCLUDE 'other.bdf'\n"), "another file is included"),
        ("f.bdf", nastran(before="GRDSET          4\n"), "GRDSET"),
        ("f.bdf", nastran(before="grid    90\n"), "6 nodes, of which meshio reads 5"),
        ("f.bdf", nastran().replace(b"BEGIN BULK", b""), "meshio cannot read it"),
        ("f.msh", ansys(declared=6), "6 nodes, of which meshio reads 5"),
        ("f.msh", b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", "a file of Gmsh"),
        ("f.msh", b"(2 3)\n", "does not declare its nodes"),
        ("f.vtu", vtu([("U", MOVES), ("U", MOVES)]), "two arrays at nodes have the name `U`"),
        ("f.vtu", vtu([("U", MOVES[:4])]), "meshio cannot read it"),
        ("f.vtu", vtu([("U", MOVES)], POINTS[:, :2]), "have the shape (5, 2)"),
        ("f.vtu", b"", "meshio cannot read it"),
        ("f.vtk", vtk().replace(b"UNSTRUCTURED_GRID", b"POLYDATA"), "(not POLYDATA)"),
        ("f.vtk", vtk()[:-30], "meshio cannot read it"),
        ("f.xdmf", xdmf(f"<Grid>{xdmf_mesh()}</Grid><Grid>{xdmf_mesh()}</Grid>"), "one grid"),
    ],
)
def test_what_meshio_would_misread_is_refused(tmp_path, name, content, words):
    path = put(tmp_path, name, content)
    other = {} if name in WITH_RESULTS else {"targets": put(tmp_path, f"o-{name}", content)}
    assert words in refusal(path, **other)


def test_an_instance_that_stays_is_read(tmp_path):
    path = put(tmp_path, "f.inp", abaqus(after=INSTANCE.format("")))
    other = put(tmp_path, "g.inp", abaqus(POINTS + MOVES, after=INSTANCE.format("")))
    np.testing.assert_array_equal(read_field(path, targets=other).goals, POINTS + MOVES)


class TestXdmf:
    def h5(self, path):
        import h5py

        with h5py.File(path, "w") as out:
            out["points"], out["moves"] = POINTS, MOVES
            out["soft"] = h5py.SoftLink("/moves")
            out["away"] = h5py.ExternalLink("other.h5", "/moves")
            out.create_dataset("outside", (5, 3), "f8", external=[("/etc/passwd", 0, 120)])
            out.create_dataset("huge", (10**9, 3), "f8", chunks=(1000, 3))
            out["text"] = "words"
            out["few"] = MOVES[:4]

    def file(self, folder, place):
        self.h5(folder / "data.h5")
        points = item(POINTS, "data.h5:/points", "HDF")
        field = xdmf_field(item(MOVES, place, "HDF"))
        inside = f'<Grid GridType="Uniform">{xdmf_mesh(points)}{field}</Grid>'
        return put(folder, "f.xdmf", xdmf(inside))

    def test_numbers_in_a_file_beside_it(self, tmp_path):
        field = read_field(self.file(tmp_path, "data.h5:/moves"))
        np.testing.assert_array_equal(field.sources, POINTS)
        np.testing.assert_array_equal(field.goals, MOVES)

    @pytest.mark.parametrize(
        ("place", "words"),
        [
            ("../data.h5:/moves", "'../data.h5', and are read only from a file beside it"),
            ("/tmp/data.h5:/moves", "only from a file beside it"),
            ("..:/moves", "only from a file beside it"),
            ("data.h5", "only from a file beside it"),
            ("none.h5:/moves", "there is no such file"),
            ("link.h5:/moves", "this is a link"),
            ("data.h5:/none", "there is no such array"),
            ("data.h5:/moves/more", "there is no such array"),
            ("data.h5:/soft", "this is a link to another place"),
            ("data.h5:/away", "this is a link to another place"),
            ("data.h5:/outside", "its numbers lie in another file"),
            ("data.h5:/huge", "it has the shape (1000000000, 3), and should have '5 3'"),
            ("data.h5:/text", "no array of numbers"),
            ("data.h5:/few", "it has the shape (4, 3), and should have '5 3'"),
            ("data.h5:/", "there is no such array"),
        ],
    )
    def test_no_other_file_is_read(self, tmp_path, place, words):
        path = self.file(tmp_path, place)
        (tmp_path / "link.h5").symlink_to(tmp_path / "data.h5")
        assert words in refusal(path)

    def test_arrays_that_take_too_much_are_refused(self, tmp_path):
        self.h5(tmp_path / "data.h5")
        huge = item(MOVES, "data.h5:/huge", "HDF").replace('"5 3"', '"1000000000 3"')
        inside = f'<Grid GridType="Uniform">{xdmf_mesh()}{xdmf_field(huge)}</Grid>'
        assert "its arrays take 22,888 MiB" in refusal(put(tmp_path, "f.xdmf", xdmf(inside)))

    def test_raw_binary_files_are_not_read(self, tmp_path):
        moves = item(MOVES, "/etc/passwd", "Binary")
        inside = f'<Grid GridType="Uniform">{xdmf_mesh()}{xdmf_field(moves)}</Grid>'
        assert "the format 'Binary'" in refusal(put(tmp_path, "f.xdmf", xdmf(inside)))

    def test_the_last_of_several_times_is_taken_and_said(self, tmp_path):
        last = xdmf_field(item(MOVES * 3))
        path = put(tmp_path, "f.xdmf", xdmf_series(xdmf_mesh() + xdmf_field(), last))
        field = read_field(path)
        np.testing.assert_array_equal(field.goals, MOVES * 3)
        assert "the last of 2 time steps is taken, at 1" in field.notes
        moved = xdmf_mesh(item(POINTS + 1)) + last
        path = put(tmp_path, "g.xdmf", xdmf_series(xdmf_mesh() + xdmf_field(), moved))
        assert "its nodes are other ones at each time" in refusal(path)

    def test_a_grid_with_its_time(self, tmp_path):
        inside = f'<Grid GridType="Uniform"><Time Value="2"/>{xdmf_mesh()}{xdmf_field()}</Grid>'
        field = read_field(put(tmp_path, "f.xdmf", xdmf(inside)))
        np.testing.assert_array_equal(field.goals, MOVES)


def test_a_reader_that_never_ends_is_ended(tmp_path, monkeypatch):
    """meshio looks for the end of a section for ever."""
    monkeypatch.setattr(mesh_files, "_SECONDS", 1)
    path = put(tmp_path, "f.msh", ansys().replace(b"(10 (1 1 5 1 3)(", b"(10 (1 1 5 1 3)")[:-60])
    said = refusal(path, targets=path)
    assert "within 1 s and" in said or "meshio cannot read it" in said


def test_a_bomb_is_refused(tmp_path, monkeypatch):
    """Zeros that unpack to 512 MiB."""
    import base64
    import zlib

    monkeypatch.setattr(mesh_files, "_MEMORY", 1 << 28)
    packed = zlib.compress(bytes(1 << 29), 1)
    header = np.array([1, 1 << 29, 1 << 29, len(packed)], dtype=np.uint32).tobytes()
    text = (base64.b64encode(header) + base64.b64encode(packed)).decode()
    content = vtu([("U", MOVES)], binary=True).decode().replace('format="binary">', "{}", 1)
    start, rest = content.split("{}")
    bomb = f'{start}format="binary">{text}{rest[rest.index("</DataArray>") :]}'
    bomb = bomb.replace("<VTKFile ", '<VTKFile compressor="vtkZLibDataCompressor" ')
    said = refusal(put(tmp_path, "f.vtu", bomb.encode()))
    assert "memory" in said


def test_nothing_is_read_without_meshio(tmp_path, monkeypatch):
    monkeypatch.setattr(mesh_files, "find_spec", lambda name: None)
    said = refusal(put(tmp_path, "f.vtu", FORMATS["f.vtu"][0]))
    assert "need the package meshio" in said
    assert "pip install 'ffdcli[fields]'" in said


def test_the_process_imports_nothing_from_the_current_folder(tmp_path):
    path = put(tmp_path, "f.vtu", FORMATS["f.vtu"][0])
    put(tmp_path, "meshio.py", b"raise SystemExit(7)")
    code = "import sys; from ffdcli.fields.read import read_field; read_field(sys.argv[1])"
    env = os.environ | {"PYTHONPATH": os.environ.get("PYTHONPATH", os.getcwd())}
    subprocess.run([sys.executable, "-P", "-c", code, path], cwd=tmp_path, check=True, env=env)
