"""Parts prepared once: what further deformations give, and what they no longer do."""

import numpy as np
import pytest

from ffdcli import Coplanar, deform, prepare, read_lattice, read_part
from ffdcli.deformation import Deformation
from ffdcli.errors import LatticeError, MeshError
from ffdcli.part import new_geometry
from support import parts

TWIST = """\
version: 1
points: [4, 4, 5]
edits:
  - twist: {axis: w, angle: 40}
  - move: {at: [0, 1, 3], by: [0.3, -0.2, 0.1]}
"""


@pytest.fixture
def job(tmp_path):
    def make(name, text=TWIST):
        part = read_part(parts.write_part(name, tmp_path))
        (tmp_path / "lattice.yaml").write_text(text)
        return part, read_lattice(tmp_path / "lattice.yaml", part)

    return make


def worst(lattice, result, seed=3):
    """Largest distance of the new surfaces from the deformation, as a share of their bounds."""
    done, rng = result.deformed, np.random.default_rng(seed)
    images, ratios = Deformation.of(lattice, done.part.delta).images, []
    for old, new, plane, (low, high), bound in zip(
        done.part.surfaces,
        done.surfaces,
        done.planes,
        done.part.rectangles,
        done.face_bounds,
        strict=True,
    ):
        if new is None or plane is not None or old.kind == "plane":
            continue
        at = (low + rng.random((400, 2)) * (high - low)).T
        off = np.linalg.norm(new.points(*at) - images(old.points(*at)), axis=1).max()
        ratios.append(off / max(bound, 1e-9 * done.part.size))
    return max(ratios)


def test_a_plan_for_one_lattice_gives_what_deform_gives(job):
    """Jobs of a batch share it: no file may depend on the jobs before."""
    part, lattice = job("cylinder")
    plan = prepare(part, lattice, once=True)
    for scale in (1.0, 0.5):
        mine, own = plan.deform(lattice.scaled(scale)), deform(part, lattice.scaled(scale))
        for one, other in zip(mine.deformed.surfaces, own.deformed.surfaces, strict=True):
            np.testing.assert_array_equal(one.poles, other.poles)
        for one, other in zip(mine.deformed.curves, own.deformed.curves, strict=True):
            np.testing.assert_array_equal(one.poles, other.poles)


@pytest.mark.parametrize("name", ["plate", "sphere", "loft"])
def test_a_plan_fits_other_lattices_within_the_tolerance(job, name):
    part, lattice = job(name)
    plan = prepare(part, lattice, fit_tolerance=1e-5 * part.size)
    first = plan.deform(lattice)
    for scale in (0.6, -0.4, 1.5):
        again = plan.deform(lattice.scaled(scale))
        assert 0 < again.max_error <= 1e-5 * part.size
        assert worst(lattice.scaled(scale), again) <= 1
        assert again.deformed.control_points >= first.deformed.control_points * (scale < 1)
    assert plan.deform(lattice.scaled(0)).report["faces_by"]["unchanged"] == part.face_count


def test_a_lattice_that_does_less_keeps_the_knots_of_the_plan(job):
    part, lattice = job("cylinder")
    fine, less = 1e-7 * part.size, lattice.scaled(0.05)
    plan = prepare(part, lattice, fit_tolerance=fine)
    full, mine = plan.deform(lattice).deformed, plan.deform(less).deformed
    for one, other in zip(full.surfaces, mine.surfaces, strict=True):
        for ours, its in zip(one.knots, other.knots, strict=True):
            np.testing.assert_array_equal(ours, its)
    assert deform(part, less, fit_tolerance=fine).deformed.control_points < full.control_points


def test_only_the_first_deformation_looks_for_knot_planes(job, monkeypatch):
    part, lattice = job("plate")
    plan, asked = prepare(part, lattice), []
    for name in ("surface_target", "curve_target"):
        monkeypatch.setattr(new_geometry, name, lambda *a: asked.append(a))
    plan.deform(lattice.scaled(0.7))
    assert not asked


def test_other_lattices_are_refused(job):
    part, lattice = job("cylinder")
    plan = prepare(part, lattice, once=True)
    low, high = part.bounds.tolist()
    half = f"box: {{min: {low}, max: [{high[0]}, {high[1]}, 4]}}\n"
    plain = TWIST[: TWIST.index("  - move")]
    for text in (
        TWIST.replace("[4, 4, 5]", "[4, 4, 6]"),
        TWIST.replace("points:", "degree: [2, 3, 3]\npoints:"),
        plain.replace("points:", f"{half}points:"),
    ):
        with pytest.raises(LatticeError, match="prepared for other degrees, knots, borders"):
            plan.deform(job("cylinder", text)[1])


def test_options_for_planes_and_solids(job, tmp_path):
    part, lattice = job("cylinder")
    for options in ({"patches": "bezier"}, {"coplanar": Coplanar(0.1, 1.0)}):
        with pytest.raises(MeshError, match=f"the option `{next(iter(options))}` is for planes"):
            prepare(part, lattice, **options)
    prepare(part, lattice, require_solid=True, once=True)


def test_a_part_of_planes_is_planned_as_a_mesh(tmp_path):
    import cadquery as cq

    cq.exporters.export(cq.Workplane().box(4, 3, 2), str(tmp_path / "box.step"))
    part = read_part(tmp_path / "box.step")
    (tmp_path / "lattice.yaml").write_text(TWIST)
    lattice = read_lattice(tmp_path / "lattice.yaml", part)
    assert prepare(part, lattice).deform(lattice).report["mesh"]["polygons"] == 12
