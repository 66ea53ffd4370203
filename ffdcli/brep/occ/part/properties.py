"""Area, volume and centre of parts, by which receivers check an import (CAx-IF)."""

from __future__ import annotations

from typing import Any

# Relative error of stated properties.
_ERROR = 1e-6
# Relative error that tells a solid from one that is inside out.
_COARSE = 1e-3


def states_properties(label: Any) -> bool:
    """Whether a file states area, volume or centre of a label's shape."""
    return any(label.IsAttribute(kind) for kind in _kinds())


def forget_properties(label: Any) -> bool:
    """Forget what a file states of a label's shape; whether it stated anything."""
    known = states_properties(label)
    for kind in _kinds():
        label.ForgetAttribute(kind)
    return known


def _kinds() -> list[Any]:
    from OCP.XCAFDoc import XCAFDoc_Area, XCAFDoc_Centroid, XCAFDoc_Volume

    return [each.GetID_s() for each in (XCAFDoc_Area, XCAFDoc_Centroid, XCAFDoc_Volume)]


def state_properties(label: Any, millimetres: float) -> None:
    """State area, volume and centre of a label's shape anew.

    Parameters
    ----------
    label : TDF_Label
    millimetres : float
        Length of the shape's unit: OpenCascade states areas and volumes in millimetres.
    """
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.XCAFDoc import XCAFDoc_Area, XCAFDoc_Centroid, XCAFDoc_ShapeTool, XCAFDoc_Volume

    shape = XCAFDoc_ShapeTool.GetShape_s(label)
    area, volume = GProp_GProps(), GProp_GProps()
    BRepGProp.SurfaceProperties_s(shape, area, _ERROR)
    BRepGProp.VolumeProperties_s(shape, volume, _ERROR)
    XCAFDoc_Area.Set_s(label, area.Mass() * millimetres**2)
    XCAFDoc_Volume.Set_s(label, volume.Mass() * millimetres**3)
    XCAFDoc_Centroid.Set_s(label, volume.CentreOfMass())


def inside_out(solid: Any) -> bool:
    """Whether the faces of a solid look inwards."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    volume = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid, volume, _COARSE)
    return bool(volume.Mass() < 0)
