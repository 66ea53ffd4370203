"""Result of a run with mesh output: triangles, their report, and mesh files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.corners import edge_keys
from ffdcli.errors import CheckError
from ffdcli.files import require_place
from ffdcli.formats import MeshFormat
from ffdcli.mesh import Mesh
from ffdcli.mesh.io.painted_mesh import UNPAINTED, Paint, PaintedMesh
from ffdcli.mesh.io.write import require_mesh_format, write_mesh
from ffdcli.stopwatch import Progress, Stopwatch

# Default tolerance, as a share of the mesh size.
DEFAULT_TOLERANCE = 2e-4
# Rounding in the file gives a warning if it exceeds this share of the tolerance.
_ROUNDING_SHARE = 0.1


@dataclass(frozen=True)
class MeshResult:
    """Triangles of a deformed mesh.

    Parameters
    ----------
    mesh : Mesh
        The undeformed mesh.
    about : mapping
        Section of the report on what was deformed, by its name.
    mode : {"exact", "vertices", "uniform", "adaptive"}
    rest, points : (V, 3) float64, model length
        Vertices before and after the deformation.
    triangles : (T, 3) int64
        Counter-clockwise seen from outside, after the deformation.
    owner : (T,) int64
        Face of the B-rep, or polygon of the mesh, of each triangle.
    polygon : (T,) int64
        Polygon of the mesh of each triangle; one of them if a face joins several.
    deviation : float, model length
        Largest distance found between the triangles and the exact surface.
    tolerance : float or None, model length
        Tolerance of the run.
    unit : str
    seconds : dict of str to float
    warnings : tuple of str
    facts : mapping
        Further entries of the report.
    uv : (T, 3, 2) float64 or None
        Texture coordinates of the corners of triangles; NaN where the mesh has none.
    output, bytes, rounding : str, int, float, or None
        Set by :meth:`write`.
    """

    mesh: Mesh
    about: Mapping[str, Any]
    mode: str
    rest: Floats
    points: Floats
    triangles: Ints
    owner: Ints
    polygon: Ints
    deviation: float
    tolerance: float | None
    unit: str
    seconds: dict[str, float]
    warnings: tuple[str, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)
    uv: Floats | None = None
    output: str | None = None
    bytes: int | None = None
    rounding: float | None = None

    @property
    def groups(self) -> dict[str, Ints]:
        """Triangles of each named group of the mesh."""
        return {
            name: np.flatnonzero(np.isin(self.polygon, members))
            for name, members in self.mesh.groups.items()
        }

    @property
    def paint(self) -> Paint:
        """Materials of the triangles."""
        labels = self.mesh.labels
        return Paint(labels.materials, labels.material[self.polygon]) if labels else UNPAINTED

    @property
    def report(self) -> dict[str, Any]:
        """The report of ``ffd deform --json``."""
        return {
            "output": self.output,
            **self.about,
            "mesh_mode": self.mode,
            "triangles": len(self.triangles),
            "vertices": len(self.points),
            "watertight": is_closed(self.triangles),
            "exact": False,
            "tolerance": self.tolerance,
            "max_deviation": self.deviation,
            "rounding": self.rounding,
            **self.facts,
            "unit": self.unit,
            "bytes": self.bytes,
            "seconds": {name: round(spent, 4) for name, spent in self.seconds.items()},
            "warnings": list(self.warnings),
        }

    def write(
        self, path: str | Path, *, unit: str | None = None, progress: Progress | None = None
    ) -> MeshResult:
        """Write a mesh file in the format of its extension, complete or not at all.

        Parameters
        ----------
        path : str or Path
            ``.stl``, ``.obj``, ``.ply``, ``.off``, ``.glb`` or ``.3mf``.
        unit : str, optional
            Unit to state in the file; only 3MF does so.

        Returns
        -------
        MeshResult
            This result with file name, size, rounding and seconds in its report.
        """
        kind = require_mesh_output(path)
        stage = Stopwatch(progress)
        with stage("write"):
            unit, name = unit or self.unit, Path(self.mesh.source).stem
            painted = PaintedMesh(
                self.points, self.triangles, self.groups, self.paint, self.uv, name, unit
            )
            written = write_mesh(path, painted)
        warnings = (*self.warnings, *self._left_out(kind))
        if kind.name == "GLB" and unit != "m":
            warnings += (
                "the unit of GLB files is the metre: other programs will read the numbers of this"
                f" file, which are in {unit}, as metres",
            )
        allowed = self.deviation if self.tolerance is None else self.tolerance
        if written.collapsed or written.rounding > _ROUNDING_SHARE * allowed > 0:
            warnings += (
                f"{kind.name} files hold single precision: vertices move by up to"
                f" {written.rounding:.2g}, and {written.collapsed} triangles collapse;"
                " .obj files keep all digits",
            )
        if written.unnamed:
            more = len(written.unnamed) - 3
            names = [*written.unnamed[:3], *([f"{more} more"] if more > 0 else [])]
            warnings += (
                f"{kind.name} files name whole bodies only: names of groups within bodies are left"
                f" out ({', '.join(names)})",
            )
        return replace(
            self,
            unit=unit,
            seconds={**self.seconds, **stage.seconds},
            warnings=warnings,
            output=str(path),
            bytes=written.bytes,
            rounding=written.rounding,
        )

    def _left_out(self, kind: MeshFormat) -> list[str]:
        """Warnings about what the format does not hold."""
        lost = {
            "names": (self.mesh.groups or self.mesh.labels is not None) and not kind.names,
            "colours": self.paint.coloured and not kind.colours,
            "texture coordinates": self.mesh.uv is not None and not kind.texture,
        }
        what = _listed([name for name, missing in lost.items() if missing])
        lines = [f"{kind.name} files cannot hold {what}: they are left out"] if what else []
        images = any(each.image for each in self.paint.materials)
        if images and kind.texture and kind.name != "OBJ":
            lines.append("file names of texture images are left out: only .obj files hold them")
        bare = 0 if self.uv is None else int(np.isnan(self.uv[:, 0, 0]).sum())
        if bare and kind.name in ("PLY", "GLB"):
            lines.append(
                f"{kind.name} files need texture coordinates for all triangles: the {bare} without"
                " any get (0, 0)"
            )
        return lines


def _listed(words: list[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def is_closed(triangles: Ints) -> bool:
    """Whether triangles (T, 3) are closed: they use each edge equally often in both directions.

    More than once each if several surfaces share two vertices.
    """
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    keys = edge_keys(tails, heads, int(triangles.max(initial=-1)) + 1)
    ahead = tails < heads
    return np.array_equal(np.sort(keys[ahead]), np.sort(keys[~ahead]))


def require_whole(points: Floats, triangles: Ints) -> None:
    """Raise a CheckError if triangles of a closed model are not closed, or inside out."""
    if not is_closed(triangles):
        raise CheckError("the triangles are not closed", hint="please report it with the files")
    arms = points[triangles] - points[triangles[:1, :1]]
    volume = float(np.einsum("ti,ti->", arms[:, 0], np.cross(arms[:, 1], arms[:, 2]))) / 6
    if volume <= 0:
        raise CheckError(
            f"the deformed mesh encloses no volume: {volume:.3g}",
            hint="nothing was written; the lattice may fold the model over",
        )


def require_mesh_output(path: str | Path, unit: str | None = None) -> MeshFormat:
    """Mesh format of an output file; a FileError if it is none, or the folder does not exist."""
    kind = require_mesh_format(path, unit)
    require_place(path)
    return kind
