"""The CAD sample: what its lattice file promises holds of the file that is written."""

import importlib.util
import json

import numpy as np
import pytest

from ffdcli import read_part
from ffdcli.brep.occ.processes.process import KernelProcess
from support.commands import ffd
from support.places import SAMPLES

PART, LATTICE = SAMPLES / "cad" / "bracket.step", SAMPLES / "cad" / "bracket.yaml"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The part as read, the part as written, and the report."""
    out = tmp_path_factory.mktemp("cad") / "bracket.step"
    text = ffd("deform", PART, LATTICE, "-o", out, "--json", kernel=KernelProcess).stdout
    return read_part(PART), read_part(out), json.loads(text)


def numbers(record):
    """Every number of a surface."""
    return [np.asarray(value).tolist() for value in vars(record).values()]


def test_report_tells_the_shares(run):
    part, written, report = run
    assert report["faces"] == part.face_count == written.face_count == 38
    assert report["faces_by"] == {"unchanged": 23, "exact": 11, "fitted": 4}
    assert report["watertight"]
    assert report["solids"] == 1
    assert 0 < report["max_error"] <= 1e-5 * part.size
    assert report["jacobian"]["injective"] == "yes"
    assert written.valid
    assert written.face_names == part.face_names
    assert written.solid_names == part.solid_names == ("body",)
    assert report["warnings"] == []


def test_plate_stays_to_the_bit(run):
    part, written, _ = run
    plate = [n for n, (low, high) in enumerate(part.rectangles) if _on_plate(part, n, low, high)]
    assert len(plate) >= 14
    for face in plate:
        assert written.surfaces[face].kind == part.surfaces[face].kind
        assert numbers(written.surfaces[face]) == numbers(part.surfaces[face])


def _on_plate(part, face, low, high):
    u, v = np.meshgrid(*np.linspace(low, high, 9).T)
    return part.surfaces[face].points(u, v)[..., 0].max() < 10 + 1e-9


def test_seat_moves_as_one_and_stays_flat_and_round(run):
    part, written, _ = run
    seat = part.face_names.index("seat")
    before, after = part.surfaces[seat], written.surfaces[seat]
    assert before.kind == after.kind == "plane"
    assert before.origin == pytest.approx([105, 0, 24], abs=1e-9)
    assert after.origin == pytest.approx([105, 0, 9], abs=1e-9)
    (bore,) = [
        n
        for n, surface in enumerate(part.surfaces)
        if surface.kind == "cylinder" and surface.radius == 9
    ]
    assert written.surfaces[bore].kind == "cylinder"
    assert written.surfaces[bore].radius == pytest.approx(9, rel=1e-12)
    # The bore stays perpendicular to the seat.
    assert abs(written.surfaces[bore].z @ after.z) == pytest.approx(1, abs=1e-12)


def test_iges_and_brep_hold_the_same_faces(run, tmp_path):
    part, written, _ = run
    for extension in (".igs", ".brep"):
        out = tmp_path / f"bracket{extension}"
        ffd("deform", PART, LATTICE, "-o", out, kernel=KernelProcess)
        ffd("verify", out, PART, LATTICE)
        again = read_part(out)
        assert [each.kind for each in again.surfaces] == [each.kind for each in written.surfaces]
        assert again.bounds == pytest.approx(written.bounds, abs=1e-9)
        # BREP has no names: its body has none either.
        named = extension == ".igs"
        assert again.face_names == (part.face_names if named else (None,) * part.face_count)
        assert again.solid_names == (("body",) if named else (None,))


def test_sample_can_be_made_again(tmp_path):
    spec = importlib.util.spec_from_file_location("make", SAMPLES / "make_cad_samples.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.main(tmp_path)
    part, again = read_part(PART), read_part(tmp_path / "cad" / "bracket.step")
    assert again.face_count == part.face_count
    assert again.face_names.count("seat") == again.face_names.count("wall") == 1
    assert again.bounds == pytest.approx(part.bounds, abs=1e-6)
    assert PART.stat().st_size < 400_000
