"""Measure the page of `ffd edit` from an event of the mouse to the frame that shows it.

`python benchmarks/edit_page.py [--vertices 100000] [--points 10] [--moves 40] [--draw]` drags a
point of an ellipsoid through its page in headless Chromium. It prints medians over the moves:

- `server`: processor time of `ffd edit` for one move, from its message to the new vertices,
- `script`: time of the page for the frame with the new vertices,
- `event to frame`: from the event of the mouse to the end of that frame.

Headless Chromium has no graphics card: with `--draw` its processor draws the triangles, which takes
far longer than the rest, and `event to frame` is to their last pixel. Without it no triangle is
drawn, and everything else is done as ever.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import psutil
import trimesh
from playwright.sync_api import Page, sync_playwright

from ffdcli.editor.page.scene import VIEW_ANGLE, first_view

WIDTH, HEIGHT = 800, 480
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
AXES = np.array([50.0, 30.0, 20.0])

# `large` is the size in bytes from which an upload is one of the model's vertices.
SCRIPT = """
window.latest = null; window.frames = []; window.spent = 0;
addEventListener("pointermove", (event) => { latest = event.timeStamp; }, true);
const kind = WebGL2RenderingContext.prototype, upload = kind.bufferSubData;
let uploaded = false;
kind.bufferSubData = function (...given) {
  uploaded ||= given[2] && given[2].byteLength >= %(large)d;
  return upload.apply(this, given);
};
const request = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = (draw) => request((time) => {
  const start = performance.now();
  draw(time);
  if (!uploaded || latest === null) return;
  uploaded = false;
  const called = performance.now();
  const context = document.querySelector("canvas[data-engine]").getContext("webgl2");
  context.readPixels(0, 0, 1, 1, context.RGBA, context.UNSIGNED_BYTE, new Uint8Array(4));
  frames.push([performance.now() - latest, called - start]);
});
"""
WITHOUT_DRAWING = """
for (const name of ["drawElements", "drawArrays", "drawElementsInstanced", "drawArraysInstanced"])
  WebGL2RenderingContext.prototype[name] = () => {};
"""


def ellipsoid(vertices: int) -> trimesh.Trimesh:
    """A closed surface with about so many vertices."""
    rows = int(np.sqrt(vertices))
    around, down = np.meshgrid(
        np.linspace(0, 2 * np.pi, rows, endpoint=False),
        np.linspace(0, np.pi, rows + 2)[1:-1],
        indexing="ij",
    )
    ring = np.stack(
        [np.cos(around) * np.sin(down), np.sin(around) * np.sin(down), np.cos(down)], axis=-1
    )
    points = np.vstack([ring.reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]]) * AXES
    own = np.arange(rows * rows).reshape(rows, rows)
    beside = np.roll(own, -1, axis=0)
    quads = np.stack([own[:, :-1], own[:, 1:], beside[:, 1:], beside[:, :-1]], axis=-1)
    quads = quads.reshape(-1, 4)
    top, bottom = np.full(rows, rows * rows), np.full(rows, rows * rows + 1)
    faces = [
        quads[:, [0, 1, 2]],
        quads[:, [0, 2, 3]],
        np.stack([top, own[:, 0], beside[:, 0]], axis=-1),
        np.stack([bottom, beside[:, -1], own[:, -1]], axis=-1),
    ]
    return trimesh.Trimesh(points, np.concatenate(faces), process=False)


def pixel(page: Page, point: np.ndarray) -> np.ndarray:
    """Where a new tab shows a point of the model."""
    eye, target = first_view(np.stack([-AXES, AXES]))
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    x, y, depth = np.stack([right, np.cross(ahead, right), ahead]) @ (point - eye)
    box = page.locator("canvas[data-engine]").bounding_box()
    assert box is not None
    scale = box["height"] / 2 / np.tan(VIEW_ANGLE / 2) / depth
    middle = np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])
    return middle + scale * np.array([x, y])


def measure(folder: Path, vertices: int, points: int, moves: int, *, draw: bool) -> None:
    """Run `ffd edit` on a new model, drag a point, print the medians."""
    mesh = ellipsoid(vertices)
    mesh.export(folder / "model.ply")
    (folder / "model.yaml").write_text(f"version: 1\npoints: [{points}, {points}, {points}]\n")
    command = [sys.executable, "-c", "from ffdcli.cli import main; main()", "edit", "model.ply"]
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    with (
        subprocess.Popen(
            [*command, "--no-open"], cwd=folder, stdout=subprocess.PIPE, text=True
        ) as process,
        sync_playwright() as play,
    ):
        assert process.stdout is not None
        address = next(line for line in process.stdout if line.startswith("page: "))[6:].strip()
        browser = play.chromium.launch(executable_path=chromium, args=FLAGS)
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.set_default_timeout(300_000)
        page.add_init_script(SCRIPT % {"large": 12 * len(mesh.vertices)})
        if not draw:
            page.add_init_script(WITHOUT_DRAWING)
        page.goto(address, wait_until="commit")
        # The first verdict comes once the model rests.
        page.get_by_text("fold").first.wait_for()
        x, y = pixel(page, np.array([0.0, 0.0, AXES[2]]))
        page.mouse.move(x, y)
        page.mouse.down()
        # The first move begins the drag, the next one shows it.
        page.mouse.move(x + 8, y - 8)
        page.mouse.move(x + 9, y - 9)
        page.wait_for_function("frames.length > 0")
        server, spent = psutil.Process(process.pid), 0.0
        found = []
        for move in range(moves):
            page.evaluate("frames.length = 0")
            used = sum(server.cpu_times()[:2])
            page.mouse.move(x + 8 + move % 20, y - 10 - move % 30)
            page.wait_for_function("frames.length > 0")
            spent += sum(server.cpu_times()[:2]) - used
            found.append(page.evaluate("frames[0]"))
        page.mouse.up()
        frame, script = (statistics.median(each) for each in zip(*found, strict=True))
        print(f"{len(mesh.vertices)} vertices, {points**3} control points, {moves} moves, ms each:")
        server_time = 1000 * spent / moves
        print(f"server {server_time:.1f}, script {script:.1f}, event to frame {frame:.1f}")
        browser.close()
        process.terminate()


def main() -> None:
    """Read the options and measure."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--vertices", type=int, default=100_000)
    parser.add_argument("--points", type=int, default=10, help="control points along each axis")
    parser.add_argument("--moves", type=int, default=40)
    parser.add_argument("--draw", action="store_true", help="draw the triangles too")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        measure(Path(folder), options.vertices, options.points, options.moves, draw=options.draw)


if __name__ == "__main__":
    main()
