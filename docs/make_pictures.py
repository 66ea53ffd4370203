"""Make the pictures of the README again: `python docs/make_pictures.py [SAMPLE ...]`.

Left, a sample mesh in its lattice at rest; right, the CAD faces it becomes, in the edited lattice.
Draws off-screen with the VTK that comes with cadquery.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import vtkmodules.vtkRenderingFreeType
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  (registers the renderer)
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkGlyph3D, vtkPolyDataNormals
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkIOImage import vtkPNGWriter
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkLight,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkTextActor,
    vtkWindowToImageFilter,
)

from ffdcli import deform, read_lattice, read_mesh
from ffdcli.mesh import triangles

Floats = NDArray[np.float64]

HERE = Path(__file__).parent
# Okabe and Ito's palette, which colour-blind people can tell apart.
MESH, CAD, LATTICE, POINT, LINE = "#d5d8dc", "#8cc7ec", "#e69f00", "#d55e00", "#20303c"

# Mesh file; direction it is looked at from; size of the picture, halves side by side or (where the
# model is long) one above the other.
SCENES: dict[str, tuple[str, tuple[float, float, float], tuple[int, int], bool]] = {
    "bracket": ("bracket.obj", (0.75, -1.0, 0.62), (1300, 600), False),
    "bottle": ("bottle.obj", (0.55, -1.0, 0.3), (1200, 800), False),
    "creature": ("creature.ply", (0.75, -1.0, 0.35), (1100, 520), False),
    "handle": ("handle.obj", (0.25, -1.0, -0.35), (1200, 560), True),
}


def draw(name: str) -> Path:
    """One picture of a sample; returns its path."""
    file, direction, size, stacked = SCENES[name]
    samples = HERE.parent / "samples"
    mesh = read_mesh(samples / file)
    lattice = read_lattice(samples / f"{name}.yaml", mesh)
    result = deform(mesh, lattice)

    corners, _ = triangles(mesh)
    ball = 0.012 * float(np.cbrt(np.prod(np.ptp(mesh.bounds, axis=0))))
    tails = mesh.corners
    heads = np.concatenate(
        [
            np.roll(mesh.corners[a:b], -1)
            for a, b in zip(mesh.starts[:-1], mesh.starts[1:], strict=True)
        ]
    )
    before = [
        _surface(mesh.vertices, corners, MESH, smooth=False),
        _lines(mesh.vertices[np.stack([tails, heads], axis=1)], LINE, 0.8),
        *_lattice(lattice.scaled(0).volume, ball),
    ]
    points, cells, edges = _tessellate(result.shape, 3e-4 * mesh.size)
    after = [
        _surface(points, cells, CAD, smooth=True),
        _lines(edges, LINE, 1.6),
        *_lattice(lattice.volume, ball),
    ]
    faces = result.report["faces"]
    titles = (
        f"{file}: {mesh.polygon_count} polygons",
        f"{name}.step: one solid of {faces} exact faces",
    )
    rest = lattice.scaled(0).volume.net.reshape(-1, 3)
    nets = [lattice.volume.frame.to_model(net) for net in (rest, lattice.volume.net.reshape(-1, 3))]
    everything = np.concatenate([mesh.vertices, points, *nets])
    window = vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetSize(*size)
    window.SetMultiSamples(8)
    for side, (actors, title) in enumerate(zip((before, after), titles, strict=True)):
        renderer = _renderer(actors, title)
        low = (0, (1 - side) / 2) if stacked else (side / 2, 0)
        high = (1, low[1] + 0.5) if stacked else (low[0] + 0.5, 1)
        renderer.SetViewport(*low, *high)
        width, height = (high[0] - low[0]) * size[0], (high[1] - low[1]) * size[1]
        _frame(renderer, everything, np.array(direction), width, height)
        window.AddRenderer(renderer)
    window.Render()
    image = vtkWindowToImageFilter()
    image.SetInput(window)
    image.ReadFrontBufferOff()
    path = HERE / "images" / f"{name}.png"
    writer = vtkPNGWriter()
    writer.SetCompressionLevel(9)
    writer.SetFileName(str(path))
    writer.SetInputConnection(image.GetOutputPort())
    writer.Write()
    return path


def _renderer(actors: list[vtkActor], title: str) -> vtkRenderer:
    """One half of the picture."""
    renderer = vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    for actor in actors:
        renderer.AddActor(actor)
    text = vtkTextActor()
    text.SetInput(title)
    text.SetPosition(20, 14)
    text.GetTextProperty().SetFontSize(22)
    text.GetTextProperty().SetColor(*_rgb(LINE))
    renderer.AddViewProp(text)
    for place, intensity in (((0.5, 0.8, 1), 0.6), ((-1, 0.2, 0.8), 0.45), ((0, -1, 0.6), 0.25)):
        light = vtkLight()
        light.SetLightTypeToCameraLight()
        light.SetPosition(*place)
        light.SetIntensity(intensity)
        renderer.AddLight(light)
    return renderer


def _frame(
    renderer: vtkRenderer, points: Floats, toward: Floats, width: float, height: float
) -> None:
    """Look along a direction, without perspective, at just these points and room for a title."""
    toward = toward / np.linalg.norm(toward)
    right = np.cross([0, 0, 1], toward)
    right /= np.linalg.norm(right)
    across = np.stack([right, np.cross(toward, right)])
    low, high = (points @ across.T).min(axis=0), (points @ across.T).max(axis=0)
    margin, title = 16, 44
    scale = max((high - low) / [width - 2 * margin, height - margin - title])
    middle = ((low + high) / 2 - [0, scale * (title - margin) / 2]) @ across
    distance = 4 * np.linalg.norm(np.ptp(points, axis=0))
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetParallelScale(scale * height / 2)
    camera.SetFocalPoint(*middle)
    camera.SetPosition(*(middle + distance * toward))
    camera.SetViewUp(*across[1])
    renderer.ResetCameraClippingRange()


def _tessellate(shape: Any, tolerance: float) -> tuple[Floats, NDArray[np.int64], Floats]:
    """Points, triangles and edge segments of CAD faces; every face has points of its own."""
    points: list[Floats] = []
    cells: list[NDArray[np.int64]] = []
    count = 0
    shape.mesh(tolerance, 0.15)
    for face in shape.Faces():
        corners, faces = face.tessellate(tolerance, 0.15)
        points.append(np.array([p.toTuple() for p in corners]))
        cells.append(np.array(faces, dtype=np.int64).reshape(-1, 3) + count)
        count += len(corners)
    shares = np.linspace(0, 1, 65)
    edges = [
        np.array([edge.startPoint().toTuple(), edge.endPoint().toTuple()])
        if edge.geomType() == "LINE"
        else np.array([p.toTuple() for p in edge.positions(shares, mode="parameter")])
        for edge in shape.Edges()
    ]
    segments = [np.stack([line[:-1], line[1:]], axis=1) for line in edges]
    return np.concatenate(points), np.concatenate(cells), np.concatenate(segments)


def _surface(points: Floats, cells: NDArray[np.int64], colour: str, *, smooth: bool) -> vtkActor:
    data = _polydata(points)
    data.SetPolys(_cells(cells))
    mapper = vtkPolyDataMapper()
    if smooth:
        normals = vtkPolyDataNormals()
        normals.SetInputData(data)
        normals.SplittingOff()
        normals.ConsistencyOff()
        mapper.SetInputConnection(normals.GetOutputPort())
    else:
        mapper.SetInputData(data)
    # Lines lie on the surface: push it back a little, so that they are seen.
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(2, 8)
    actor = vtkActor()
    actor.SetMapper(mapper)
    look = actor.GetProperty()
    look.SetColor(*_rgb(colour))
    look.SetAmbient(0.3)
    look.SetDiffuse(0.8)
    if not smooth:
        look.SetInterpolationToFlat()
    return actor


def _lines(segments: Floats, colour: str, width: float) -> vtkActor:
    data = _polydata(segments.reshape(-1, 3))
    data.SetLines(_cells(np.arange(2 * len(segments)).reshape(-1, 2)))
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(data)
    actor = vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(*_rgb(colour))
    actor.GetProperty().SetLineWidth(width)
    actor.GetProperty().LightingOff()
    return actor


def _lattice(volume: Any, radius: float) -> list[vtkActor]:
    """Control points as balls, and the lines between neighbours."""
    net = volume.frame.to_model(volume.net)
    segments = [
        np.stack([np.moveaxis(net, axis, 0)[:-1], np.moveaxis(net, axis, 0)[1:]], axis=-2)
        for axis in range(3)
    ]
    lines = _lines(np.concatenate([part.reshape(-1, 2, 3) for part in segments]), LATTICE, 1.2)
    ball = vtkSphereSource()
    ball.SetRadius(radius)
    ball.SetThetaResolution(14)
    ball.SetPhiResolution(14)
    glyph = vtkGlyph3D()
    glyph.SetInputData(_polydata(net.reshape(-1, 3)))
    glyph.SetSourceConnection(ball.GetOutputPort())
    glyph.ScalingOff()
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(glyph.GetOutputPort())
    balls = vtkActor()
    balls.SetMapper(mapper)
    balls.GetProperty().SetColor(*_rgb(POINT))
    return [lines, balls]


def _polydata(points: Floats) -> vtkPolyData:
    places = vtkPoints()
    places.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
    data = vtkPolyData()
    data.SetPoints(places)
    return data


def _cells(index: NDArray[np.int64]) -> vtkCellArray:
    offsets = np.arange(0, index.size + 1, index.shape[1])
    cells = vtkCellArray()
    cells.SetData(
        numpy_to_vtkIdTypeArray(offsets, deep=True),
        numpy_to_vtkIdTypeArray(np.ascontiguousarray(index.ravel()), deep=True),
    )
    return cells


def _rgb(colour: str) -> tuple[float, float, float]:
    return tuple(int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))


if __name__ == "__main__":
    for sample in sys.argv[1:] or SCENES:
        print(draw(sample))
