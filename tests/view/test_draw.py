"""PNG pictures, drawn without a display."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from ffdcli.cli import main
from ffdcli.view.camera import look
from ffdcli.view.colours import CELL, HIDDEN, LATTICE, POINT, rgb
from ffdcli.view.draw import draw
from ffdcli.view.panel import Arrows, Balls, Panel, Strokes, Triangles
from support.places import SAMPLES

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)


def pixels(content: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB"), dtype=np.int64)


def share(image: np.ndarray, colour: str) -> float:
    wanted = np.round(255 * np.array(rgb(colour)))
    return float((np.abs(image - wanted).max(axis=2) < 60).mean())


def test_what_lies_in_front_covers_what_lies_behind():
    paint = np.tile(rgb("#8cc7ec"), (2, 1))
    plate = Triangles(SQUARE, np.array([[0, 1, 2], [0, 2, 3]]), paint, smooth=False)
    middle = np.array([[0.5, 0.5, 0.2]])

    def balls(points):
        panel = Panel("", (plate, Balls(points, POINT, 30.0)))
        return share(pixels(draw([panel], width=400, direction=(0, -0.1, 1))), POINT)

    assert balls(middle) > 0.005
    assert balls(middle * [1, 1, -1]) == 0


def test_strokes_and_arrows_are_drawn():
    ends = np.array([[[0, 0, 0], [1, 0, 0.5]]])
    for part in (Strokes(ends, LATTICE, 3.0), Arrows(ends, LATTICE)):
        image = pixels(draw([Panel("", (part,))], width=400))
        assert (image < 250).any(axis=2).mean() > 0.002
        assert share(image, LATTICE) > 0.0003


def test_a_look_shows_all_points():
    points = np.random.default_rng(3).normal(size=(50, 3))
    view = look(points, np.array([1.0, -2.0, 0.5]))
    right = np.cross(view.up, view.toward)
    seen = (points - view.middle) @ np.stack([right, view.up]).T
    assert np.allclose(np.abs(seen).max(axis=0), np.array(view.extent) / 2, rtol=1e-12)


def test_before_and_after(artefacts):
    out = artefacts / "fish.png"
    args = [SAMPLES / "drags" / "fish.obj", SAMPLES / "drags" / "fish-4.yaml", "-o", out]
    with pytest.raises(SystemExit) as end:
        main(["view", *map(str, args), "--width", "1200"])
    assert end.value.code == 0
    image = pixels(out.read_bytes())
    assert image.shape[1] == 1200
    for half in np.split(image, 2, axis=1 if image.shape[0] < 900 else 0):
        assert share(half, LATTICE) > 0.0005
        assert 0.05 < (half.min(axis=2) < 250).mean() < 0.95


def test_hidden_control_points_are_drawn_on_request_and_the_frame_follows(
    job, tmp_path, capsys, artefacts
):
    # A hierarchical volume has control points far outside the model.
    job("volume: hierarchical\ndegree: [3, 3, 3]\noctree: {depth: 2}\n")
    args = [tmp_path / "mesh.obj", tmp_path / "lattice.yaml", "--width", "900"]
    images = []
    for name, more in (("octree", []), ("octree-hidden", ["--hidden-points"])):
        out = artefacts / f"{name}.png"
        with pytest.raises(SystemExit) as end:
            main(["view", *map(str, args), *more, "-o", str(out)])
        assert end.value.code == 0
        images.append(pixels(out.read_bytes())[:, :450])
    without, every = (share(image, HIDDEN) for image in images)
    assert every > 0.001
    assert without < 0.2 * every
    # The model is drawn smaller, to make room for them.
    model = [share(image, CELL) for image in images]
    assert min(share(image, POINT) for image in images) > 0.0005
    assert model[1] < 0.7 * model[0]


@pytest.mark.parametrize(
    ("args", "words", "status"),
    [
        (["m.obj", "l.yaml", "-o", "p.gif"], ".html, .png", 1),
        (["m.obj", "-o", "p.png"], "name its file", 2),
        (["m.step", "l.yaml", "-o", "p.png", "--compare"], "needs a mesh", 2),
        (["m.step", "-o", "p.png", "--hidden-points"], "needs a lattice", 2),
        (
            ["m.obj", "l.yaml", "-o", "p.png", "--error", "exact", "--fit-tolerance", "1"],
            "--error",
            2,
        ),
        (["none.step", "-o", "p.png"], "none.step", 1),
        (["m.obj", "l.yaml", "-o", "no/p.png"], "folder", 1),
    ],
)
def test_refusals(tmp_path, monkeypatch, capsys, args, words, status):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        main(["view", *args])
    assert end.value.code == status
    assert words in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
