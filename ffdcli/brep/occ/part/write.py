"""CAD parts written with new geometry, all else as it was read."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from ffdcli.brep.occ.check import KernelVerdict, kernel_check
from ffdcli.brep.occ.formats import UNPAINTED, IgesMode, Schema, cad_format
from ffdcli.brep.occ.part.document import (
    document_of,
    name_of,
    named_labels,
    root_shapes,
    set_name,
)
from ffdcli.brep.occ.part.labels import body_labels, colours_in
from ffdcli.brep.occ.part.load import load_document
from ffdcli.brep.occ.part.mesh import PartTriangles, triangulate_parts
from ffdcli.brep.occ.part.properties import inside_out, state_properties
from ffdcli.brep.occ.part.rebuild import Rebuild
from ffdcli.brep.occ.part.settle import settle
from ffdcli.brep.occ.part.validity import is_valid, lacking_pcurve, read_unrepaired
from ffdcli.brep.occ.part.walk import Numbering, children, face_uses, is_reversed, number_parts
from ffdcli.brep.occ.settings import exchange_settings, silent_kernel, tolerance_settings
from ffdcli.brep.occ.writing.brep import brep_bytes
from ffdcli.brep.occ.writing.far_from_origin import require_parts
from ffdcli.brep.occ.writing.header import FileHeader
from ffdcli.brep.occ.writing.iges import iges_bytes
from ffdcli.brep.occ.writing.reopen import require_readable
from ffdcli.brep.occ.writing.step import print_document, step_settings, transfer_document
from ffdcli.brep.occ.writing.step_texts import StepTexts
from ffdcli.errors import CheckError, FileError
from ffdcli.files import whole_file
from ffdcli.labels import Colour
from ffdcli.part.record import NewGeometry, Part
from ffdcli.units import unit_named


class NewPart:
    """A part with new geometry, as OpenCascade holds it.

    Parameters
    ----------
    part : Part
    new : NewGeometry
    """

    def __init__(self, part: Part, new: NewGeometry) -> None:
        self._document = document_of(part.handle)
        found = number_parts(root_shapes(self._document))
        self._stated = settle(self._document, Rebuild(part, found, new))
        self._name, self._valid = Path(part.source).stem, part.valid

    @property
    def shape(self) -> Any:
        """The shape, a compound where the file holds several."""
        shapes = root_shapes(self._document)
        return shapes[0] if len(shapes) == 1 else _compound(shapes)

    @property
    def colours(self) -> list[Colour | None]:
        """The colour of each face; None where it has none."""
        return colours_in(self._document, number_parts(root_shapes(self._document)))

    def triangles(self, tolerance: float) -> PartTriangles:
        """Triangles within a distance of the faces, model length."""
        shapes = root_shapes(self._document)
        return triangulate_parts(shapes, number_parts(shapes), tolerance)

    def check(self) -> KernelVerdict:
        """OpenCascade's own check, and that no solid is inside out, which it does not see."""
        shape = self.shape
        verdict = kernel_check(shape)
        solids = number_parts([shape]).solids
        turned = [
            f"solid {n}: it is inside out" for n, each in enumerate(solids) if inside_out(each)
        ]
        if not turned:
            return verdict
        return replace(verdict, valid=False, faults=(*verdict.faults, *turned))

    def write(
        self,
        path: str | Path,
        *,
        unit: str,
        schema: Schema = "ap214",
        pcurves: bool = True,
        iges_mode: IgesMode = "brep",
        header: FileHeader | None = None,
        processes: int = 1,
        check: bool = True,
    ) -> int:
        """Write a CAD file in the format of its extension, whole or not at all: its bytes.

        Parameters
        ----------
        path, unit, schema, pcurves, iges_mode, header, processes
            As for :func:`~ffdcli.brep.occ.writing.write.begin_cad`.
        check : bool
            Let OpenCascade read the file again before it is put in place.

        Raises
        ------
        KernelError, FileError, CheckError
        """
        kind, name, header = cad_format(path), Path(path).name, header or FileHeader()
        with whole_file(path) as stream:
            content: bytes | memoryview
            if kind == "STEP":
                content = step = self._step(name, unit, schema, pcurves, header, processes)
                require_parts(self.shape, step)
            elif kind == "IGES":
                found = number_parts(root_shapes(self._document))
                bodies = _bodies(found)
                content = iges_bytes(
                    bodies[0] if len(bodies) == 1 else _compound(bodies),
                    name,
                    unit=unit,
                    mode=iges_mode,
                    labels=body_labels(self._document, found, bodies, self._name),
                    header=header,
                )
            else:
                content = brep_bytes(self.shape)
            require_readable(str(kind), content)
            if check:
                solids = iges_mode == "brep"
                self._require_same(content, Path(path).suffix, solids=solids, pcurves=pcurves)
            return stream.write(content)

    def _require_same(
        self, content: bytes | memoryview, suffix: str, *, solids: bool, pcurves: bool
    ) -> None:
        """Reject a file that OpenCascade reads as another part, or as one that is not valid.

        IGES files of trimmed surfaces have no solids. Files without pcurves are valid only once
        their reader has made these.
        """
        mine = number_parts(root_shapes(self._document))
        with tempfile.TemporaryDirectory(prefix="ffd-") as folder:
            again = Path(folder, f"part{suffix}")
            again.write_bytes(content)
            try:
                if pcurves:
                    document, _, valid = read_unrepaired(again)
                else:
                    document, _ = load_document(again, repairs=True)
                    valid = is_valid(document)
            except FileError as error:
                raise _not_again(error.message) from error
        found = number_parts(root_shapes(document))
        for what, old, new in (
            ("faces", face_uses(mine), face_uses(found)),
            ("solids", len(mine.solids), len(found.solids)),
        ):
            if old != new and (solids or what == "faces"):
                raise _not_again(f"it has {new} {what} instead of {old}")
        if self._valid and not valid:
            bare = lacking_pcurve(found)
            if bare is not None:
                raise _not_again(f"face {bare} has an edge without a curve in its parameters")
            faults = [
                each for shape in root_shapes(document) for each in kernel_check(shape).faults
            ]
            raise _not_again("; ".join(faults))

    def _step(
        self,
        name: str,
        unit: str,
        schema: Schema,
        pcurves: bool,
        header: FileHeader,
        processes: int,
    ) -> bytes:
        from OCP.XCAFDoc import XCAFDoc_DocumentTool

        length, texts = unit_named(unit), StepTexts()
        settings = {
            **step_settings(length, schema, pcurves=pcurves),
            **tolerance_settings(self.shape),
        }
        XCAFDoc_DocumentTool.SetLengthUnit_s(self._document, length.millimetres / 1000)
        for label in self._stated if schema not in UNPAINTED else []:
            state_properties(label, length.millimetres)
        with silent_kernel(), exchange_settings(settings):
            with _renamed(self._document, texts):
                writer = transfer_document(
                    self._document, self._name, colours=schema not in UNPAINTED
                )
            return print_document(
                writer, name, header, texts, schema=schema, digits=17, processes=processes
            )


@contextmanager
def _renamed(document: Any, texts: StepTexts) -> Iterator[None]:
    """Names of a document as marks, within the block."""
    names = [(label, name_of(label) or "") for label in named_labels(document)]
    for label, name in names:
        set_name(label, texts(name))
    try:
        yield
    finally:
        for label, name in names:
            set_name(label, name)


def _not_again(message: str) -> CheckError:
    return CheckError(
        f"OpenCascade does not read the file as it was meant: {message}",
        hint="nothing was written; try another format, or report it with the files",
    )


def _bodies(found: Numbering) -> list[Any]:
    """Solids, then shells and faces outside of solids, these as shells of their own."""
    bodies = [_with_forward_shells(solid) for solid in found.solids]
    for number, (shell, solid) in enumerate(found.shells):
        if solid < 0 and shell is not None:
            bodies.append(shell)
        elif solid < 0:
            face = found.faces.FindKey(found.face_shell.index(number) + 1)
            bodies.append(_shell_of([face]))
    return bodies


def _with_forward_shells(solid: Any) -> Any:
    """A solid whose faces are reversed in place of its shells: IGES files lose that of shells."""
    from OCP.BRep import BRep_Builder

    shells = list(children(solid))
    if not any(map(is_reversed, shells)):
        return solid
    made, builder = solid.EmptyCopied(), BRep_Builder()
    for shell in shells:
        builder.Add(made, _shell_of(list(children(shell)), shell.Closed()))
    return made


def _shell_of(faces: list[Any], closed: bool = False) -> Any:
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Shell

    made, builder = TopoDS_Shell(), BRep_Builder()
    builder.MakeShell(made)
    for face in faces:
        builder.Add(made, face)
    made.Closed(closed)
    return made


def _compound(shapes: list[Any]) -> Any:
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    made, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(made)
    for shape in shapes:
        builder.Add(made, shape)
    return made
