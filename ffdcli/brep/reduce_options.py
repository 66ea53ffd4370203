"""The options of a reduction, checked without what it takes to reduce."""

from __future__ import annotations

import math

from ffdcli.errors import FfdError

# At lower degrees, surfaces that are C2 would need more knots than CAD kernels handle well.
LEAST_MAX_DEGREE = 3


def require_reducible(tolerance: float | None, max_degree: int | None) -> None:
    """Reject a tolerance that is not positive and finite, and a maximum degree that is too low."""
    if tolerance is not None and not 0 < tolerance < math.inf:
        raise FfdError(f"the tolerance must be a length above 0, not {tolerance}")
    if max_degree is None:
        return
    if max_degree < LEAST_MAX_DEGREE:
        raise FfdError(f"the highest degree must be at least {LEAST_MAX_DEGREE}, not {max_degree}")
    if tolerance is None:
        raise FfdError("a highest degree needs a tolerance", hint="give both")
