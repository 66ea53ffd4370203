"""The web page, in a real browser: it works alone, and its controls do what they say."""

from __future__ import annotations

import io

import numpy as np
import pytest

from ffdcli import deform
from ffdcli.cli import main
from ffdcli.view.colours import HIDDEN, LATTICE, LINE, POINT, rgb
from ffdcli.view.three import three_js
from support.browser import chromium
from support.jobs import read_job
from support.mesh_models import CORNERS, QUADS
from support.places import SAMPLES


def run(*args: object) -> None:
    with pytest.raises(SystemExit) as end:
        main([str(arg) for arg in args])
    assert end.value.code == 0


@pytest.fixture(scope="module")
def page_file(artefacts):
    path = artefacts / "cup.html"
    run("view", SAMPLES / "drags" / "cylinder.obj", SAMPLES / "drags" / "cup.yaml", "-o", path)
    return path


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def octree_file(artefacts, tmp_path_factory):
    folder, path = tmp_path_factory.mktemp("octree"), artefacts / "octree.html"
    # A hierarchical volume has control points far outside the model.
    text = "volume: hierarchical\ndegree: [3, 3, 3]\noctree: {depth: 2}\n"
    read_job(folder, text, CORNERS, QUADS)
    run("view", folder / "mesh.obj", folder / "lattice.yaml", "-o", path)
    return path


@pytest.fixture
def page(browser, page_file):
    yield from opened(browser, page_file)


@pytest.fixture
def octree(browser, octree_file):
    yield from opened(browser, octree_file)


def opened(browser, file):
    """A page, open, with every request and every complaint noted."""
    page = browser.new_page(viewport={"width": 1200, "height": 760})
    page.requested, page.complaints = [], []
    page.on("request", lambda request: page.requested.append(request.url))
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    page.goto(file.as_uri())
    page.wait_for_selector("html[data-ready=yes]")
    page.wait_for_function("Number(document.documentElement.dataset.drawn) > 0")
    yield page
    assert page.complaints == []
    assert all(url.startswith(("file:", "data:", "blob:")) for url in page.requested)
    page.close()


def pixels(page) -> np.ndarray:
    """(height, width, 3) what the page shows of the model."""
    from PIL import Image

    # What was asked for is drawn in the next frame.
    frame = "new Promise((drawn) => requestAnimationFrame(drawn))"
    page.evaluate(f"{frame}.then(() => {frame})")
    shot = page.screenshot(clip={"x": 260, "y": 0, "width": 940, "height": 760})
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"), dtype=np.int64)


def count(image: np.ndarray, colour: str) -> int:
    """Pixels of a colour."""
    wanted = np.round(255 * np.array(rgb(colour)))
    return int((np.abs(image - wanted).max(axis=2) < 40).sum())


def test_the_page_carries_three_js_and_asks_for_nothing(page_file):
    text = page_file.read_text()
    assert "Three.js Authors" in three_js()
    assert three_js() in text
    assert "src=" not in text.split("<script>")[0]
    assert len(text) < 3_000_000


def test_what_a_person_sees_first(page, artefacts):
    page.screenshot(path=artefacts / "page.png")
    assert page.title() == "cylinder.obj"
    image = pixels(page)
    assert count(image, LATTICE) > 200
    assert count(image, POINT) > 200
    # The model fills a good part of the window, and not all of it.
    assert 0.1 < (image.min(axis=2) < 250).mean() < 0.9


def test_layers_go_and_come_back(page):
    first = pixels(page)
    page.click("#show-lattice")
    without = pixels(page)
    assert count(without, POINT) < 0.05 * count(first, POINT)
    page.click("#show-lattice")
    assert np.array_equal(pixels(page), first)
    page.click("#show-after")
    page.click("#show-edges")
    page.click("#show-lattice")
    page.click("#show-drags")
    assert (pixels(page) == 255).all()
    page.click("#show-before")
    assert (pixels(page) < 255).any()


def test_the_deformation_runs_from_rest_to_full(page, artefacts):
    full = pixels(page)
    page.click("#rest")
    assert page.inner_text("#amplitude-value") == "0 %"
    rest = pixels(page)
    page.screenshot(path=artefacts / "page-at-rest.png")
    page.focus("#amplitude")
    for _ in range(50):
        page.keyboard.press("ArrowRight")
    assert page.inner_text("#amplitude-value") == "50 %"
    half = pixels(page)
    for one, other in ((rest, full), (rest, half), (half, full)):
        assert (one != other).any(axis=2).mean() > 0.005
    page.click("#full")
    assert page.inner_text("#amplitude-value") == "100 %"
    assert np.array_equal(pixels(page), full)


def test_dragging_turns_the_model_and_fit_brings_it_back(page):
    first = pixels(page)
    page.mouse.move(700, 400)
    page.mouse.down()
    page.mouse.move(820, 460, steps=6)
    page.mouse.up()
    assert (pixels(page) != first).any(axis=2).mean() > 0.02
    page.click("#fit")
    again = pixels(page)
    assert (again != first).any(axis=2).mean() < 0.002


def test_pointing_at_a_face_tells_what_it_is(page, artefacts):
    assert page.is_hidden("#tip")
    page.mouse.move(725, 380)
    page.wait_for_selector("#tip:not([hidden])")
    said = page.inner_text("#tip")
    page.screenshot(path=artefacts / "page-face.png")
    assert said.startswith("Face ")
    assert "degree" in said or "plane" in said
    assert float(said.split("deviation ")[1].split()[0]) < 1e-9
    page.mouse.move(280, 740)
    page.wait_for_selector("#tip", state="hidden")


def test_a_tick_shows_the_hidden_control_points_and_makes_room_for_them(octree, artefacts):
    assert not octree.is_checked("#show-hidden")
    said = octree.inner_text("label:has(#show-hidden)")
    # Levels 0, 1 and 2 have 4, 5 and 7 functions a side; shown are the corners of their full cells,
    # which all are but the one in the middle of level 2.
    shown = 2**3 + 3**3 + 5**3 - 1
    assert said == f"Hidden control points ({4**3 + 5**3 + 7**3 - shown})"
    first = pixels(octree)
    assert count(first, HIDDEN) == 0
    assert count(first, POINT) > 200
    octree.click("#show-hidden")
    every = pixels(octree)
    octree.screenshot(path=artefacts / "page-hidden.png")
    assert count(every, HIDDEN) > 200
    # The camera steps back: nothing is cut off, and the model is smaller.
    assert (np.concatenate([every[0], every[-1], every[:, 0], every[:, -1]]) == 255).all()
    assert count(every, LINE) < 0.8 * count(first, LINE)
    # They are a layer of their own.
    octree.click("#show-lattice")
    assert count(pixels(octree), HIDDEN) > 200
    octree.click("#show-lattice")
    octree.click("#show-hidden")
    assert (pixels(octree) != first).any(axis=2).mean() < 0.002


def test_a_page_without_hidden_control_points_offers_none(page):
    assert page.query_selector("#show-hidden") is None


def test_a_cad_file_alone(browser, job, tmp_path, artefacts):
    lattice = "degree: [2, 2, 2]\npoints: [3, 3, 3]\nedits:\n  - twist: {axis: u, angle: 60}\n"
    deform(*job(lattice, CORNERS * [2, 1, 1], QUADS)).write(tmp_path / "b.step")
    run("view", tmp_path / "b.step", "-o", artefacts / "cad.html")
    page = browser.new_page(viewport={"width": 1200, "height": 760})
    page.goto((artefacts / "cad.html").as_uri())
    page.wait_for_selector("html[data-ready=yes]")
    assert "6 faces" in page.inner_text("#facts")
    assert page.is_hidden("#amplitude-row")
    assert page.query_selector("#show-lattice") is None
    page.mouse.move(725, 380)
    page.wait_for_selector("#tip:not([hidden])")
    assert "degree" in page.inner_text("#tip") or "plane" in page.inner_text("#tip")
    page.screenshot(path=artefacts / "cad.png")
    page.close()
