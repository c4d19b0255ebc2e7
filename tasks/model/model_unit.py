"""The unit of an object's model, and whether poses given as matrices are in it."""

from collections.abc import Sequence

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.multiview.visual_hull import bounding_sphere
from glint.tasks.algorithms.registration.registered_views import RegisteredViews
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage_warning import StageWarning

UNIT_OF_POSES = "units of the poses"
"""Unit of a model whose matrices are neither in millimetres nor in pixels, as far as is known."""
MAX_SIZE_RATIO, MAX_DEPTH_RATIO = 1.25, 2.0
"""Ratio of the object's size by matrices to that by spheres beyond which they contradict each other, and beyond which
no sphere that lies nearer or farther than the object explains it."""
MAX_DECADE_ERROR = 0.1
"""Decades by which that ratio may differ from a power of ten for two units to explain it."""


def unit_of_model(works: Sequence[CaptureContext]) -> str:
    """Return the unit of the model's coordinates, "mm" or "pixels", the same for all views.

    Raises:
        UnusableCapture: the scale of some views is known, that of others is not.
    """
    sizes = {work.capture.id: work.load("survey").record["pixel_size"] for work in works}
    unknown = [name for name, size in sizes.items() if not size]
    if unknown and len(unknown) < len(sizes):
        raise UnusableCapture(
            f"the scale of {', '.join(unknown)} is not known, that of the other views is",
            "give pixel_size, or the diameter_mm of a sphere, for all views or for none",
        )
    return "pixels" if unknown else "mm"


def checked_unit(registered: RegisteredViews, unit: str) -> tuple[str, tuple[StageWarning, ...]]:
    """Return the unit of the registered views' world, and what contradicts it.

    Along parallel rays the silhouettes hold the unit of the matrices. The whole world of perspective views scales with
    their positions, whatever the silhouettes: there a pixel must cover at the object what it covers at the spheres.

    unit: as of `unit_of_model`.

    Raises:
        UnusableCapture: the matrices are in another unit.
    """
    on_table = 0 if registered.turntable is None else len(registered.turntable.angles)
    posed = [view for view in registered.views[on_table:] if view.matrix is not None]
    if not posed:
        return unit, ()
    centre = bounding_sphere(registered.views)[0][None]
    ratio = float(np.median([view.footprint(centre)[0] / view.pixel_size for view in posed]))
    difference = max(ratio, 1.0 / ratio)
    if difference <= MAX_SIZE_RATIO:
        return unit, ()
    if unit == "pixels":
        return UNIT_OF_POSES, ()
    message = f"by its cameras' matrices the object is {ratio:.3g} times as large as by the spheres or `pixel_size`"
    if difference > MAX_DEPTH_RATIO:
        decades = -np.log10(ratio)
        is_decimal = abs(decades - round(decades)) < MAX_DECADE_ERROR
        factor = 10.0 ** round(decades) if is_decimal else 1.0 / ratio
        raise UnusableCapture(message, f"give positions in millimetres: multiply those of all matrices by {factor:.4g}")
    remedy = "the model has the size of the matrices; check their unit, and `diameter_mm` or `pixel_size`"
    return unit, (StageWarning(f"{message}: {remedy}", "views"),)
