"""New shapes in a document: parts and assemblies keep names, colours, layers and places.

An instance that has not changed stays an instance. One that has becomes a part of its own.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

from ffdcli.brep.occ.part.document import (
    components_of,
    entry_of,
    name_of,
    referred,
    roots_of,
    set_name,
    shape_tool,
    subshapes_of,
)
from ffdcli.brep.occ.part.properties import forget_properties, states_properties
from ffdcli.brep.occ.part.rebuild import Rebuild


def settle(document: Any, rebuild: Rebuild) -> list[Any]:
    """Put new shapes in place of the shapes of a document.

    Returns the labels of new shapes for which the file stated area, volume or centre.
    """
    from OCP.TopLoc import TopLoc_Location

    whole = _Document(document, rebuild)
    for root in roots_of(document):
        whole.count(root, TopLoc_Location())
    for root in roots_of(document):
        whole.settle(root, TopLoc_Location())
    shape_tool(document).UpdateAssemblies()
    return whole.stated


class _Document:
    """A document whose labels are gone through twice: counted, then settled."""

    def __init__(self, document: Any, rebuild: Rebuild) -> None:
        self._tool, self._rebuild = shape_tool(document), rebuild
        # Places of each label where it stays, and those left where it changes.
        self.stated: list[Any] = []
        self._staying: Counter[str] = Counter()
        self._changing: Counter[str] = Counter()

    def count(self, label: Any, location: Any) -> bool:
        """Whether a label changes here; it and those below are counted."""
        if self._tool.IsAssembly_s(label):
            below = [
                self.count(referred(each), self._place(each, location))
                for each in components_of(label)
            ]
            changes = any(below)
        else:
            shape = self._tool.GetShape_s(label).Moved(location)
            changes = not self._rebuild(shape).IsPartner(shape)
        (self._changing if changes else self._staying)[entry_of(label)] += 1
        return changes

    def settle(self, label: Any, location: Any) -> tuple[Any, bool]:
        """The label of what stands here, the same or a new one, and whether it changed."""
        from OCP.XCAFDoc import XCAFDoc

        if self._tool.IsAssembly_s(label):
            parts = components_of(label)
            below = [self.settle(referred(each), self._place(each, location)) for each in parts]
            if not any(changed for _, changed in below):
                return label, False
            targets = [target for target, _ in below]
            if not self._is_last(label):
                return self._new_assembly(label, parts, targets), True
            for part, target in zip(parts, targets, strict=True):
                if not referred(part).IsEqual(target):
                    _refer(part, target, XCAFDoc.ShapeRefGUID_s())
            self._forget(label)
            return label, True
        shape = self._tool.GetShape_s(label)
        moved = self._rebuild(shape.Moved(location))
        if moved.IsPartner(shape):
            return label, False
        last = self._is_last(label)
        named = [
            (sub, self._rebuild(self._tool.GetShape_s(sub).Moved(location)))
            for sub in subshapes_of(label)
        ]
        back = location.Inverted()
        if last:
            self._tool.SetShape(label, moved.Moved(back))
            for sub, new in named:
                _set_shape(sub, new.Moved(back))
            self._forget(label)
            return label, True
        target = self._tool.AddShape(moved.Moved(back), False)
        self._copy(label, target)
        for sub, new in named:
            added = self._tool.AddSubShape(target, new.Moved(back))
            if not added.IsNull():
                _copy_labels(sub, added)
        return target, True

    def _forget(self, label: Any) -> None:
        if forget_properties(label):
            self.stated.append(label)

    def _copy(self, source: Any, target: Any) -> None:
        _copy_labels(source, target)
        if states_properties(source):
            self.stated.append(target)

    def _is_last(self, label: Any) -> bool:
        """Whether no other place needs the label as it was."""
        entry = entry_of(label)
        self._changing[entry] -= 1
        return not (self._changing[entry] or self._staying[entry])

    def _place(self, component: Any, location: Any) -> Any:
        return location.Multiplied(self._tool.GetLocation_s(component))

    def _new_assembly(self, label: Any, parts: list[Any], targets: list[Any]) -> Any:
        made = self._tool.NewShape()
        self._copy(label, made)
        for part, target in zip(parts, targets, strict=True):
            added = self._tool.AddComponent(made, target, self._tool.GetLocation_s(part))
            _copy_labels(part, added)
        return made


def _refer(label: Any, target: Any, kind: Any) -> None:
    """Make a label refer to another: an instance to its part, a part to its colour."""
    from OCP.TDataStd import TDataStd_TreeNode

    user = TDataStd_TreeNode.Set_s(label, kind)
    user.Remove()
    TDataStd_TreeNode.Set_s(target, kind).Append(user)


def _set_shape(label: Any, shape: Any) -> None:
    from OCP.TNaming import TNaming_Builder

    TNaming_Builder(label).Generated(shape)


def _copy_labels(source: Any, target: Any) -> None:
    """Copy name, colours, materials, layers and visibility, but not area and volume."""
    from OCP.TDataStd import TDataStd_TreeNode
    from OCP.XCAFDoc import XCAFDoc, XCAFDoc_ColorTool, XCAFDoc_ColorType, XCAFDoc_DocumentTool

    name = name_of(source)
    if name is not None:
        set_name(target, name)
    colours = [XCAFDoc.ColorRefGUID_s(kind) for kind in XCAFDoc_ColorType.__members__.values()]
    for kind in (*colours, XCAFDoc.MaterialRefGUID_s(), XCAFDoc.VisMaterialRefGUID_s()):
        if source.IsAttribute(kind):
            node = TDataStd_TreeNode.Set_s(source, kind)
            if node.HasFather():
                _refer(target, node.Father().Label(), kind)
    XCAFDoc_DocumentTool.ColorTool_s(source).SetVisibility(
        target, XCAFDoc_ColorTool.IsVisible_s(source)
    )
    layers = XCAFDoc_DocumentTool.LayerTool_s(source)
    names = layers.GetLayers(source)
    for number in range(1, (names.Length() if names is not None else 0) + 1):
        layers.SetLayer(target, names.Value(number))
