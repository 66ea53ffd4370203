"""Draw panels into a PNG with VTK, without a display."""

from __future__ import annotations

from typing import Any

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.view.camera import DIRECTION, Look, look
from ffdcli.view.colours import LINE, rgb
from ffdcli.view.panel import Arrows, Balls, Panel, Part, Scale, Strokes, Triangles

_MARGIN, _TITLE, _FONT = 16, 46, 22
# Panels are stacked if their contents are wider than high by this factor.
_LONG = 2.2
# Radius of an arrow's shaft in pixels.
_SHAFT = 3.0
# Panels narrower than this have smaller titles.
_WIDE = 420
# Room for a colour bar, in pixels.
_BAR = 150


def draw(
    panels: list[Panel],
    *,
    width: int,
    columns: int | None = None,
    direction: tuple[float, float, float] = DIRECTION,
) -> bytes:
    """Draw panels in rows and columns.

    Parameters
    ----------
    panels : list of Panel
    width : int
        Width of the picture in pixels; the height follows from the panels.
    columns : int, optional
        By default all panels are in one row, or in one column if their contents are long.
    direction : 3 floats
        Direction from the model to the eye.

    Returns
    -------
    bytes
        The PNG file.
    """
    import vtkmodules.vtkRenderingFreeType
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  (both register their renderers)
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkLogger
    from vtkmodules.vtkIOImage import vtkPNGWriter
    from vtkmodules.vtkRenderingCore import vtkRenderWindow, vtkWindowToImageFilter

    # VTK warns on stderr if there is no display.
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    view = look(np.concatenate([panel.points for panel in panels]), np.array(direction))
    if columns is None:
        columns = 1 if view.extent[0] > _LONG * view.extent[1] else len(panels)
    rows = -(-len(panels) // columns)
    across = width / columns
    bar = _BAR if any(panel.scale for panel in panels) else 0
    room = max(across - 2 * _MARGIN - bar, 1.0)
    tall = min(max(room * view.extent[1] / view.extent[0], 0.22 * room), 1.4 * room)
    down = tall + _MARGIN + _TITLE
    window = vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetSize(width, round(rows * down))
    window.SetMultiSamples(8)
    scale = max(view.extent[0] / room, view.extent[1] / tall)
    for number, panel in enumerate(panels):
        row, column = divmod(number, columns)
        renderer = _renderer(panel, view, scale, down, bar, min(1.0, across / _WIDE))
        bottom = 1 - (row + 1) / rows
        renderer.SetViewport(column / columns, bottom, (column + 1) / columns, bottom + 1 / rows)
        window.AddRenderer(renderer)
    window.Render()
    image = vtkWindowToImageFilter()
    image.SetInput(window)
    image.ReadFrontBufferOff()
    writer = vtkPNGWriter()
    writer.SetCompressionLevel(9)
    writer.WriteToMemoryOn()
    writer.SetInputConnection(image.GetOutputPort())
    writer.Write()
    return bytes(vtk_to_numpy(writer.GetResult()).tobytes())


def _renderer(panel: Panel, view: Look, scale: float, down: float, bar: int, shrink: float) -> Any:
    """One panel.

    ``scale`` is the model length of a pixel; ``down`` is the height of the panel and ``bar`` the
    width of its colour bar, both in pixels; ``shrink`` scales the title.
    """
    from vtkmodules.vtkRenderingCore import vtkLight, vtkRenderer, vtkTextActor

    renderer = vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    for part in panel.parts:
        renderer.AddActor(_actor(part, scale))
    text = vtkTextActor()
    text.SetInput(panel.title)
    text.SetPosition(20, 14)
    text.GetTextProperty().SetFontSize(round(_FONT * shrink))
    text.GetTextProperty().SetColor(*rgb(LINE))
    renderer.AddViewProp(text)
    if panel.scale is not None:
        renderer.AddViewProp(_bar(panel.scale))
    for place, intensity in (((0.5, 0.8, 1), 0.6), ((-1, 0.2, 0.8), 0.45), ((0, -1, 0.6), 0.25)):
        light = vtkLight()
        light.SetLightTypeToCameraLight()
        light.SetPosition(*place)
        light.SetIntensity(intensity)
        renderer.AddLight(light)
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetParallelScale(scale * down / 2)
    # The title is below the model: move the model up by half its height.
    middle = view.middle - view.up * (scale * (_TITLE - _MARGIN) / 2)
    middle = middle + np.cross(view.up, view.toward) * (scale * bar / 2)
    camera.SetFocalPoint(*middle)
    camera.SetPosition(*(middle + view.distance * view.toward))
    camera.SetViewUp(*view.up)
    renderer.ResetCameraClippingRange()
    return renderer


def _actor(part: Part, scale: float) -> Any:
    match part:
        case Triangles():
            return _facets(part)
        case Strokes():
            return _strokes(part)
        case Balls(points, colour, radius):
            return _balls(points, colour, radius * scale)
        case Arrows(ends, colour):
            return _arrows(ends, colour, _SHAFT * scale)


def _facets(part: Triangles) -> Any:
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkFiltersCore import vtkPolyDataNormals

    data = _polydata(part.points)
    data.SetPolys(_cells(part.triangles))
    paint = numpy_to_vtk((255 * part.colours).round().astype(np.uint8), deep=True)
    data.GetCellData().SetScalars(paint)
    mapper = _mapper(None)
    if part.smooth:
        normals = vtkPolyDataNormals()
        normals.SetInputData(data)
        normals.SplittingOff()
        normals.ConsistencyOff()
        mapper.SetInputConnection(normals.GetOutputPort())
    else:
        mapper.SetInputData(data)
    # Lines lie on the surface: move the surface back to keep them visible.
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(2, 8)
    actor = _shown(mapper)
    look = actor.GetProperty()
    look.SetAmbient(0.75 if part.even else 0.36)
    look.SetDiffuse(0.25 if part.even else 0.8)
    if not part.smooth:
        look.SetInterpolationToFlat()
    return actor


def _strokes(part: Strokes) -> Any:
    data = _polydata(part.segments.reshape(-1, 3))
    data.SetLines(_cells(np.arange(2 * len(part.segments)).reshape(-1, 2)))
    actor = _shown(_mapper(data))
    actor.GetProperty().SetColor(*rgb(part.colour))
    actor.GetProperty().SetLineWidth(part.width)
    actor.GetProperty().SetOpacity(part.opacity)
    actor.GetProperty().LightingOff()
    return actor


def _balls(points: Floats, colour: str, radius: float) -> Any:
    from vtkmodules.vtkFiltersCore import vtkGlyph3D
    from vtkmodules.vtkFiltersSources import vtkSphereSource

    ball = vtkSphereSource()
    ball.SetRadius(radius)
    ball.SetThetaResolution(14)
    ball.SetPhiResolution(14)
    glyph = vtkGlyph3D()
    glyph.SetInputData(_polydata(points))
    glyph.SetSourceConnection(ball.GetOutputPort())
    glyph.ScalingOff()
    mapper = _mapper(None)
    mapper.SetInputConnection(glyph.GetOutputPort())
    actor = _shown(mapper)
    actor.GetProperty().SetColor(*rgb(colour))
    return actor


def _arrows(ends: Floats, colour: str, radius: float) -> Any:
    """Arrows with the same thickness at any length."""
    from vtkmodules.vtkCommonTransforms import vtkTransform
    from vtkmodules.vtkFiltersCore import vtkAppendPolyData
    from vtkmodules.vtkFiltersGeneral import vtkTransformPolyDataFilter
    from vtkmodules.vtkFiltersSources import vtkConeSource, vtkCylinderSource

    every = vtkAppendPolyData()
    for start, end in ends:
        length = float(np.linalg.norm(end - start))
        if length == 0:
            continue
        way = (end - start) / length
        head = min(5 * radius, 0.5 * length)
        cone = vtkConeSource()
        cone.SetCenter(*(end - way * head / 2))
        cone.SetDirection(*way)
        cone.SetHeight(head)
        cone.SetRadius(2.2 * radius)
        cone.SetResolution(20)
        every.AddInputConnection(cone.GetOutputPort())
        shaft = vtkCylinderSource()
        shaft.SetRadius(0.8 * radius)
        shaft.SetHeight(length - head)
        shaft.SetResolution(14)
        turn = vtkTransform()
        turn.Translate(*(start + way * (length - head) / 2))
        axis, angle = np.cross([0, 1, 0], way), np.degrees(np.arccos(np.clip(way[1], -1, 1)))
        turn.RotateWXYZ(angle, *(axis if np.any(axis) else (1, 0, 0)))
        placed = vtkTransformPolyDataFilter()
        placed.SetTransform(turn)
        placed.SetInputConnection(shaft.GetOutputPort())
        every.AddInputConnection(placed.GetOutputPort())
    mapper = _mapper(None)
    mapper.SetInputConnection(every.GetOutputPort())
    actor = _shown(mapper)
    actor.GetProperty().SetColor(*rgb(colour))
    return actor


def _bar(scale: Scale) -> Any:
    from vtkmodules.vtkCommonCore import vtkLookupTable
    from vtkmodules.vtkRenderingAnnotation import vtkScalarBarActor

    table = vtkLookupTable()
    table.SetNumberOfTableValues(len(scale.colours))
    for number, colour in enumerate(scale.colours):
        table.SetTableValue(number, [*colour.tolist(), 1.0])
    table.SetTableRange(scale.low, scale.high)
    bar = vtkScalarBarActor()
    bar.SetLookupTable(table)
    bar.SetTitle(scale.title)
    bar.SetNumberOfLabels(5)
    bar.SetLabelFormat("{:.2g}")
    bar.SetPosition(0.87, 0.15)
    bar.SetPosition2(0.11, 0.7)
    bar.UnconstrainedFontSizeOn()
    for text in (bar.GetTitleTextProperty(), bar.GetLabelTextProperty()):
        text.SetColor(*rgb(LINE))
        text.SetFontSize(18)
        text.BoldOff()
        text.ItalicOff()
        text.ShadowOff()
    return bar


def _mapper(data: Any) -> Any:
    from vtkmodules.vtkRenderingCore import vtkPolyDataMapper

    mapper = vtkPolyDataMapper()
    if data is not None:
        mapper.SetInputData(data)
    return mapper


def _shown(mapper: Any) -> Any:
    from vtkmodules.vtkRenderingCore import vtkActor

    actor = vtkActor()
    actor.SetMapper(mapper)
    return actor


def _polydata(points: Floats) -> Any:
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkPolyData

    places = vtkPoints()
    places.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
    data = vtkPolyData()
    data.SetPoints(places)
    return data


def _cells(index: Ints) -> Any:
    from vtkmodules.util.numpy_support import numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonDataModel import vtkCellArray

    offsets = np.arange(0, index.size + 1, index.shape[1])
    cells = vtkCellArray()
    cells.SetData(
        numpy_to_vtkIdTypeArray(offsets, deep=True),
        numpy_to_vtkIdTypeArray(np.ascontiguousarray(index.ravel()), deep=True),
    )
    return cells
