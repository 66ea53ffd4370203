"""The page of `ffd edit` in a real browser: its process, its tabs, and what they show."""

from __future__ import annotations

import subprocess
import threading
from contextlib import contextmanager

import numpy as np

from support.commands import COMMAND

WIDTH, HEIGHT = 1000, 640

# three.js announces its scenes to an object that the page sets; this keeps them.
_SCENES = """
window.scenes = [];
// A notice that no graphics card draws lies over the model, and would take the mouse.
addEventListener("DOMContentLoaded", () => {
  const style = document.createElement("style");
  style.textContent = "[class*=Notifications] { display: none; }";
  document.head.append(style);
});
Object.defineProperty(window, "__THREE_DEVTOOLS__", {
  configurable: true,
  get() { return this.announced; },
  set(target) {
    this.announced = target;
    target.addEventListener("observe", (event) => {
      if (event.detail.isScene) window.scenes.push(event.detail);
    });
  },
});
window.models = () => {
  const found = [];
  for (const scene of window.scenes) scene.traverse((node) => {
    const flat = node.isMesh && node.material && node.geometry && node.geometry.index;
    if (!flat || !node.material.color || !node.geometry.index.count) return;
    found.push([node.material.color.getHex(), node.geometry.attributes.position]);
  });
  return found;
};
window.drawn = (hex) => {
  for (const [colour, position] of window.models())
    if (colour === hex) return Array.from(position.array);
  return null;
};
window.sum = (hex) => (window.drawn(hex) ?? []).reduce((sum, each) => sum + Math.abs(each), 0);
"""


class EditProcess:
    """`ffd edit` in a process of its own."""

    def __init__(self, folder, *arguments):
        self.lines, self.address = [], None
        self.process = subprocess.Popen(
            [*COMMAND, "edit", "--no-open", *map(str, arguments)],
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        for line in self.process.stdout:
            self.lines.append(line)
            if line.startswith("page: "):
                self.address = line.removeprefix("page: ").strip()
                break
        assert self.address is not None, "".join(self.lines)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        self.lines += list(self.process.stdout)

    def wait(self) -> int:
        """Exit status, once all it printed is known."""
        status = self.process.wait(timeout=120)
        self._reader.join(timeout=30)
        return status

    def kill(self) -> None:
        """End it without a chance to do anything (SIGKILL)."""
        self.process.kill()
        self.wait()


@contextmanager
def editing(folder, *arguments):
    """A running `ffd edit`, which is ended in any case."""
    running = EditProcess(folder, *arguments)
    try:
        yield running
    finally:
        if running.process.poll() is None:
            running.kill()


class Tab:
    """A tab of the page, seen from above the front of a model with given bounds (2, 3)."""

    def __init__(self, browser, address, bounds, *, width=WIDTH, height=HEIGHT):
        from ffdcli.editor.page.scene import VIEW_ANGLE, first_view

        self.complaints = []
        # A browser does not ask when a page ends together with its context.
        self._context = browser.new_context(viewport={"width": width, "height": height})
        self.page = self._context.new_page()
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.add_init_script(_SCENES)
        self.page.set_default_timeout(60_000)
        self.page.goto(address, wait_until="commit")
        self.size = float(np.linalg.norm(bounds[1] - bounds[0]))
        eye, target = first_view(np.asarray(bounds, dtype=float))
        ahead = (target - eye) / np.linalg.norm(target - eye)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        self._eye, self._axes = eye, np.stack([right, np.cross(ahead, right), ahead])
        self._half_angle = VIEW_ANGLE / 2

    def pixel(self, point):
        """Where a point (3,) of the model is seen, pixels."""
        x, y, depth = self._axes @ (np.asarray(point, dtype=float) - self._eye)
        picture = self.page.locator("canvas[data-engine]").bounding_box()
        scale = picture["height"] / 2 / np.tan(self._half_angle)
        left, top = (picture["x"] + picture["width"] / 2, picture["y"] + picture["height"] / 2)
        return np.array([left, top]) + scale * np.array([x, y]) / depth

    def says(self, text: str) -> None:
        """Wait until the panel says so."""
        self.page.get_by_text(text).first.wait_for()

    def press(self, name: str) -> None:
        """Press a button of the panel."""
        self.page.get_by_role("button", name=name, exact=True).click()

    def open(self, tab: str) -> None:
        """Open a tab of the panel."""
        self.page.get_by_role("tab", name=tab).click()

    def drawn(self, colour) -> np.ndarray:
        """(n, 3) vertices that three.js holds of the faces of a colour."""
        array = self.page.evaluate(f"window.drawn({_hex(colour)})")
        return np.array(array, dtype=float).reshape(-1, 3)

    def wait_for_change(self, colour, before) -> None:
        """Wait until the faces of a colour have other vertices than those before."""
        was = float(np.abs(before).sum())
        self.page.wait_for_function(
            f"Math.abs(window.sum({_hex(colour)}) - {was!r}) > {1e-3 * self.size}"
        )

    def wait_for(self, colour, vertices) -> None:
        """Wait until the faces of a colour have certain vertices."""
        total = float(np.abs(vertices).sum())
        self.page.wait_for_function(
            f"Math.abs(window.sum({_hex(colour)}) - {total!r}) < {1e-4 * self.size}"
        )

    def drag(self, start, to, colour) -> None:
        """Drag with the mouse from one point of space to another; wait until the model follows."""
        before, mouse = self.drawn(colour), self.page.mouse
        (x, y), (u, v) = self.pixel(start), self.pixel(to)
        mouse.move(x, y)
        mouse.down()
        mouse.move(x + (u - x) / 8, y + (v - y) / 8, steps=2)
        mouse.move(u, v, steps=3)
        self.wait_for_change(colour, before)
        mouse.up()


def _hex(colour) -> int:
    red, green, blue = (int(each) for each in colour)
    return (red << 16) + (green << 8) + blue
