"""Pipes, devices, sockets, folders and null characters are refused wherever a file is named."""

import json
import os
import socket

import numpy as np
import pytest

from ffdcli.errors import FileError
from ffdcli.files import read_file, require_place
from support.commands import ffd
from support.jobs import CUBE, CUBE_FACES, obj

LATTICE = "version: 1\nvolume: nurbs\ndegree: [1, 1, 1]\npoints: [2, 2, 2]\n"
DEVICES = ("/dev/zero", "/dev/null")


@pytest.fixture
def places(tmp_path):
    """Names of no regular file, and a phrase of the refusal of each."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("pipe")
    with socket.socket(socket.AF_UNIX) as listener:
        here = os.getcwd()
        os.chdir(tmp_path)
        listener.bind("socket")
        os.chdir(here)
        names = [str(tmp_path / name) for name in ("pipe", "link", "socket")]
        yield {
            **dict.fromkeys((*names, *DEVICES), "not a regular file"),
            str(tmp_path): "folder",
            str(tmp_path / "gone"): "no such file",
        }


@pytest.fixture
def good(tmp_path):
    (tmp_path / "a.obj").write_text(obj(CUBE, CUBE_FACES))
    (tmp_path / "a.yaml").write_text(LATTICE)
    return tmp_path


def test_reading(places):
    for place, words in {**places, "a\0b": "null character"}.items():
        with pytest.raises(FileError, match=words) as caught:
            read_file(place)
        assert caught.value.file == place
        assert caught.value.hint
    with pytest.raises(FileError, match="null character"):
        require_place("a\0b.step")


@pytest.mark.parametrize(
    "command",
    [
        "info PLACE.obj",
        "info PLACE.stl",
        "info PLACE.dae",
        "info PLACE.yaml",
        "info PLACE.step",
        "info PLACE.iges",
        "info PLACE.brep",
        "info a.yaml --mesh PLACE.ply",
        "deform PLACE.off a.yaml -o o.step",
        "deform a.obj PLACE.yaml -o o.step",
        "deform PLACE.glb a.yaml -o o.obj",
        "new PLACE.3mf",
        "solve a.obj PLACE.yaml",
        "view PLACE.gltf a.yaml -o o.html",
        "view PLACE.step -o o.html",
        "verify PLACE.step a.obj a.yaml",
        "verify o.step a.obj a.yaml --against PLACE.json",
        "batch PLACE.yaml",
    ],
)
@pytest.mark.parametrize("kind", ["pipe", "/dev/zero"])
def test_commands(good, places, monkeypatch, command, kind):
    monkeypatch.chdir(good)
    words = [word for word in command.split() if "PLACE" in word]
    (good / words[0]).symlink_to(kind)
    result = ffd(*command.split(), status=1)
    assert f"{words[0]}: this is not a regular file" in result.stderr
    assert not (good / "o.step").exists()


@pytest.mark.parametrize(
    ("key", "name"),
    [
        ("edits: [{net: NAME}]", "n.npy"),
        ("edits: [{weights: NAME}]", "n.csv"),
        ("edits: [{drag: {pairs: NAME}}]", "n.csv"),
    ],
)
@pytest.mark.parametrize("kind", ["pipe", "/dev/zero", "."])
def test_files_that_a_lattice_names(good, places, key, name, kind):
    (good / name).symlink_to(kind)
    (good / "b.yaml").write_text(LATTICE + key.replace("NAME", name) + "\n")
    result = ffd("info", str(good / "b.yaml"), "--mesh", good / "a.obj", status=1)
    assert ("not a regular file" in result.stderr) or (kind == "." and "folder" in result.stderr)
    (good / "b.yaml").write_text(LATTICE + key.replace("NAME", r'"a\0b.npy"') + "\n")
    result = ffd("info", str(good / "b.yaml"), "--mesh", good / "a.obj", status=1)
    assert "internal" not in result.stderr


@pytest.mark.parametrize("name", ["pipe", "/dev/zero", "a\0b.mtl", "."])
def test_materials_of_an_obj(good, places, name):
    (good / "b.obj").write_text(f"mtllib {name}\nusemtl red\n" + obj(CUBE, CUBE_FACES))
    result = ffd("info", str(good / "b.obj"), "--json")
    notes = json.loads(result.stdout)["warnings"]
    assert [note for note in notes if "colours" in note], notes


@pytest.mark.parametrize("kind", ["pipe", "/dev/zero", "gone"])
@pytest.mark.parametrize("place", ["mesh", "lattice"])
def test_batches(good, places, kind, place):
    names = {"mesh": "a.obj", "lattice": "a.yaml", place: "x.obj" if place == "mesh" else "x.yaml"}
    (good / names[place]).symlink_to(kind)
    (good / "jobs.yaml").write_text(
        f"version: 1\noutput: o.step\n"
        f"jobs: [{{mesh: {names['mesh']}, lattice: {names['lattice']}}}]\n"
    )
    result = ffd("batch", str(good / "jobs.yaml"), "-j", "1", "--json", status=1)
    error = json.loads(result.stdout)["jobs"][0]["error"]
    assert error["kind"] == "file"
    assert ("no such file" if kind == "gone" else "not a regular file") in error["message"]


def test_names_with_brackets_are_files_first(good):
    for name, size in (("x[1]", 1), ("x1", 2), ("y?", 1), ("y*", 1), ("{z}", 1)):
        (good / f"{name}.obj").write_text(obj(np.array(CUBE) * size, CUBE_FACES))
    (good / "l[1].yaml").write_text(LATTICE)
    from ffdcli.batch.jobs import list_jobs

    def listed(mesh, lattice="l[1].yaml"):
        text = f'version: 1\noutput: "{{number}}.step"\njobs: [{{mesh: "{mesh}", '
        text += f'lattice: "{lattice}"}}]\n'
        (good / "jobs.yaml").write_text(text)
        return [(job.mesh, job.lattice) for job in list_jobs(good / "jobs.yaml")]

    for name in ("x[1].obj", "y?.obj", "y*.obj", "{z}.obj"):
        assert listed(name) == [(name, "l[1].yaml")]
    assert listed("x[12].obj") == [("x1.obj", "l[1].yaml")]
    assert listed("x?.obj", "l[[]1].yaml") == [("x1.obj", "l[1].yaml")]
