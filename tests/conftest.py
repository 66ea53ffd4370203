"""Fixtures of all tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

from ffdcli import read_lattice, read_mesh
from support.pipeline_models import CUBE, CUBE_FACES

# The same examples on every run, however long they take. Others are tried by
# `python -m pytest --hypothesis-profile=random`.
settings.register_profile("random", deadline=None)
settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")


@pytest.fixture(scope="session")
def artefacts(tmp_path_factory) -> Path:
    """The folder that FFD_ARTEFACTS names, or a temporary one."""
    named = os.environ.get("FFD_ARTEFACTS")
    folder = Path(named) if named else tmp_path_factory.mktemp("artefacts")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture
def job(tmp_path):
    """Write a mesh and a lattice file and read them back, as a user would have them."""

    def make(lattice, points=CUBE, faces=CUBE_FACES, volume="bspline"):
        mesh_path, lattice_path = tmp_path / "mesh.obj", tmp_path / "lattice.yaml"
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
        lines += ["f " + " ".join(str(v + 1) for v in face) for face in faces]
        mesh_path.write_text("\n".join(lines) + "\n")
        lattice_path.write_text(f"version: 1\nvolume: {volume}\n{lattice}")
        mesh = read_mesh(mesh_path)
        return mesh, read_lattice(lattice_path, mesh)

    return make
