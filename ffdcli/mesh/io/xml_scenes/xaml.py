"""Triangles of XAML files, and places in them that their reader does not know."""

from __future__ import annotations

from typing import Any

from ffdcli.mesh.io.xml_scenes.tally import Refused, SceneCounts, local_name


def count_xaml(root: Any) -> SceneCounts:
    """The triangles of all meshes of a document.

    Raises
    ------
    Refused
        A mesh or its place is given in a way that the reader does not know.
    """
    triangles = 0
    for element in root.iter():
        kind = local_name(element)
        owner, _, key = kind.rpartition(".")
        if key == "Transform" and not owner.endswith(("Camera", "Light")):
            moves = [e for e in element.iter() if local_name(e).endswith("Transform3D")]
            places = [local_name(e) for e in moves if not _is_turn_of_nothing(e)]
            if places and (owner != "ModelVisual3D" or places != ["MatrixTransform3D"]):
                message = f"a `{kind}` of the file is no matrix of a `ModelVisual3D`: {places[0]}"
                raise Refused(message, "export it in another format such as .obj or .glb")
        if "Transform" in element.attrib and not kind.endswith(("Camera", "Light")):
            raise Refused(f"the place of a `{kind}` is given by a resource")
        if kind == "GeometryModel3D" and "Geometry" in element.attrib:
            raise Refused("the geometry of a `GeometryModel3D` is a resource")
        if kind == "MeshGeometry3D":
            triangles += len((element.get("TriangleIndices") or "").replace(",", " ").split()) // 3
    return SceneCounts(triangles, None)


def _is_turn_of_nothing(element: Any) -> bool:
    """Whether an element turns by an angle of 0, as SolidWorks writes it."""
    angles = [turn.get("Angle") for turn in element.iter("{*}AxisAngleRotation3D")]
    return (
        local_name(element) == "RotateTransform3D"
        and bool(angles)
        and not any(float(angle or 0) for angle in angles)
    )
