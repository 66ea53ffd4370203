"""STEP files written by OpenCascade and directly, and what OpenCascade reads of each."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.brep.labels import ShapeLabels, label_shape
from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.part.document import (
    components_of,
    name_of,
    referred,
    roots_of,
    subshapes_of,
)
from ffdcli.brep.occ.reading.read import read_cad, record_of
from ffdcli.brep.occ.settings import exchange_settings, silent_kernel
from ffdcli.brep.occ.writing.write import write_cad
from ffdcli.brep.record import Brep
from ffdcli.brep.step.write import write_step

# Rounding of plane parameters and unit vectors, which compilers may sum in another order.
_ULPS = 8 * np.finfo(float).eps


def write_both(brep: Brep, folder: Path, labels: ShapeLabels | None = None, **how: Any) -> Path:
    """Write ``kernel.step`` and ``direct.step``: the path of the second."""
    labels = labels or label_shape(brep, "part", None)
    write_cad(build_shape(brep), folder / "kernel.step", labels=labels, **how)
    write_step(brep, folder / "direct.step", labels=labels, **how)
    return folder / "direct.step"


def differences(folder: Path) -> list[str]:
    """What OpenCascade reads differently, healing off, of the files of :func:`write_both`."""
    kernel, direct = (read_cad(folder / f"{name}.step") for name in ("kernel", "direct"))
    assert kernel.unit == direct.unit
    return _differ(record_of(kernel), record_of(direct), "")


def _differ(one: Any, other: Any, where: str) -> list[str]:
    if isinstance(one, tuple):
        if len(one) != len(other):
            return [f"{where}: {len(one)} and {len(other)}"]
        pairs = enumerate(zip(one, other, strict=True))
        return [text for i, pair in pairs for text in _differ(*pair, f"{where}[{i}]")]
    if dataclasses.is_dataclass(one):
        names = [field.name for field in dataclasses.fields(one)]
        return [
            text
            for name in names
            for text in _differ(getattr(one, name), getattr(other, name), f"{where}.{name}")
        ]
    if not isinstance(one, np.ndarray):
        return [] if one == other else [f"{where}: {one} and {other}"]
    if one.shape != other.shape:
        return [f"{where}: shapes {one.shape} and {other.shape}"]
    if one.tobytes() == other.tobytes():
        return []
    axes = where.startswith(".planes") and where.endswith("_axis")
    if axes and np.abs(one - other).max() <= _ULPS:
        return []
    return [f"{where}: {(one != other).sum()} of {one.size} values"]


def document(path: Path) -> list[dict[str, Any]]:
    """Names, colours, layers and properties of a STEP file, as OpenCascade's XDE reads them.

    Assemblies have their parts in order; faces are in the order of their facts.
    """
    from OCP.Quantity import Quantity_Color
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import (
        XCAFDoc_Area,
        XCAFDoc_Centroid,
        XCAFDoc_ColorTool,
        XCAFDoc_ColorType,
        XCAFDoc_DocumentTool,
        XCAFDoc_ShapeTool,
        XCAFDoc_Volume,
    )

    reader = STEPCAFControl_Reader()
    reader.SetLayerMode(True)
    reader.SetPropsMode(True)
    made = TDocStd_Document(TCollection_ExtendedString("BinXCAF"))
    with silent_kernel(), exchange_settings({"read.stepcaf.subshapes.name": "1"}):
        reader.ReadFile(str(path))
        assert reader.Transfer(made)
    layers = XCAFDoc_DocumentTool.LayerTool_s(made.Main())

    def facts(label: Any) -> dict[str, Any]:
        found: dict[str, Any] = {"name": name_of(label)}
        shape = XCAFDoc_ShapeTool.GetShape_s(label)
        found["kind"] = "none" if shape.IsNull() else shape.ShapeType().name
        colour = Quantity_Color()
        if XCAFDoc_ColorTool.GetColor_s(label, XCAFDoc_ColorType.XCAFDoc_ColorSurf, colour):
            found["colour"] = np.round([colour.Red(), colour.Green(), colour.Blue()], 5).tolist()
        held = layers.GetLayers(label)
        count = 0 if held is None else held.Length()
        found["layers"] = sorted(held.Value(i).ToExtString() for i in range(1, count + 1))
        for kind in (XCAFDoc_Area, XCAFDoc_Volume, XCAFDoc_Centroid):
            # Asking for an attribute that is not there ends the process.
            if label.IsAttribute(kind.GetID_s()):
                value = kind()
                label.FindAttribute(kind.GetID_s(), value)
                stated = value.Get()
                found[kind.__name__] = stated.Coord() if hasattr(stated, "Coord") else stated
        found["faces"] = sorted(map(facts, subshapes_of(label)), key=repr)
        found["parts"] = [(name_of(each), facts(referred(each))) for each in components_of(label)]
        return found

    return [facts(label) for label in roots_of(made)]
