"""When polygons count as coplanar (Feng 2002, section 3.3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.errors import FfdError

# Polygons at up to this angle to a plane, in degrees, do not fold over when moved onto it.
_LARGEST_ANGLE = 30


@dataclass(frozen=True)
class Coplanar:
    """What counts as coplanar beyond the noise of the mesh.

    Parameters
    ----------
    distance : float, optional, model length
        Distance within which vertices lie in the plane of their region; that of the mesh's noise
        (its ``delta``) by default.
    angle : float, optional, degree
        Largest angle between a polygon and the plane of its region, at most 30; without it the
        distance alone decides.

    Raises
    ------
    FfdError
        Not positive, too large, or a distance without an angle.
    """

    distance: float | None = None
    angle: float | None = None

    def __post_init__(self) -> None:
        if self.distance is not None and not 0 < self.distance < np.inf:
            raise FfdError(f"the coplanar distance must be a length above 0, not {self.distance}")
        if self.angle is not None and not 0 < self.angle <= _LARGEST_ANGLE:
            raise FfdError(
                f"the coplanar angle must be above 0 and at most {_LARGEST_ANGLE} degrees, "
                f"not {self.angle}"
            )
        if self.distance is not None and self.angle is None:
            raise FfdError(
                "a coplanar distance needs a coplanar angle, so that walls lower than the distance "
                "stay apart",
                hint="the paper's are 1.1e-6 and 0.012 degrees",
            )

    def within(self, delta: float) -> float:
        """The distance, for a mesh with this delta."""
        return delta if self.distance is None else self.distance

    @property
    def sine(self) -> float:
        """Sine of the angle; 1 without one."""
        return 1.0 if self.angle is None else float(np.sin(np.radians(self.angle)))


DEFAULT = Coplanar()
