"""Scale: the millimetres of a pixel, as given or from the spheres' diameters, and what contradicts it.

Lengths in metres or micrometres look like any others, so the sizes that follow are compared: of a sphere with those of
chrome spheres, of the object with those of objects on a table.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glint.storage.catalogue import models
from glint.tasks.algorithms.geometry.perspective import Cone, areal_focal_length
from glint.tasks.algorithms.lighting.spheres import Sphere, is_radius_corrected
from glint.tasks.engine.stage_warning import StageWarning

MAX_SCALE_RATIO = 1.05
"""Ratio of two scales beyond which they contradict each other."""
MIN_DIAMETER_MM, MAX_DIAMETER_MM = 4.0, 500.0
"""Diameters of the smallest and largest chrome spheres: usual ones of 20 to 40 mm are less in centimetres or inches."""
MIN_OBJECT_MM, MAX_OBJECT_MM = 3.0, 3000.0
"""Longer side of the regions of the smallest and largest objects: a bead, and a window's height."""
USUAL_OBJECT_MM = 10.0, 1000.0
"""Longer side of the regions of most objects: a unit that leads to it is the one that was probably meant."""
LIKELY_UNITS = {"metres": 1e3, "micrometres": 1e-3}
"""Millimetres of other units that were perhaps meant, and that lead to no usual size if they were not."""


@dataclass(frozen=True, slots=True)
class Scale:
    """pixel_size: millimetres of a pixel, None: unknown; warnings: what contradicts it."""

    pixel_size: float | None
    warnings: Sequence[StageWarning] = ()

    @property
    def unit(self) -> str:
        """Unit of depth."""
        return "pixels" if self.pixel_size is None else "mm"


def scale_of(
    pixel_size: float | None,
    given: Sequence[models.Sphere],
    used: Sequence[Sphere],
    camera: np.ndarray | None,
    extent: float | None = None,
) -> Scale:
    """Return the scale: as given, or the mean of those that the spheres' diameters give.

    A given radius holds unless the measured one differs by more than its uncertainty.

    Args:
        pixel_size: as given, millimetres.
        given: spheres of the catalogue.
        used: circle of each of them as it was measured, or of those that were found if none is given, pixels.
        camera: perspective camera's matrix (3, 3).
        extent: longer side of the object's region, pixels.
    """
    measured = _measured_scales(given, used, camera)
    if not measured:
        return Scale(pixel_size, [] if pixel_size is None else _unlikely(pixel_size, used, camera, extent))
    warnings, sizes = _doubts_of_spheres(measured), [size for _, size in measured]
    if pixel_size is None:
        mean = float(np.mean(sizes))
        return Scale(mean, warnings or _unlikely_diameters([diameter for diameter, _ in measured], mean, extent))
    if max(pixel_size, *sizes) > MAX_SCALE_RATIO * min(pixel_size, *sizes):
        owners = "sphere's" if len(sizes) == 1 else "spheres'"
        contradiction = _warning(
            f"`pixel_size` {pixel_size:.3g} contradicts the {owners} {_joined_scales(sizes)} mm per pixel: it is used;"
            " correct or remove it, or correct `diameter_mm`"
        )
        return Scale(pixel_size, [*warnings, contradiction])
    return Scale(pixel_size, warnings or _unlikely(pixel_size, (), camera, extent))


def length_text(millimetres: float) -> str:
    """Return a length with the unit in which it is easily read."""
    metres = millimetres / 1e3
    if metres >= 1.0:
        return f"{metres / 1e3:.3g} km" if metres >= 1e3 else f"{metres:.3g} m"
    return f"{millimetres:.3g} mm" if millimetres >= 0.1 else f"{1e3 * millimetres:.3g} micrometres"


def _measured_scales(
    given: Sequence[models.Sphere], used: Sequence[Sphere], camera: np.ndarray | None
) -> list[tuple[float, float]]:
    """Return the diameter in millimetres of each sphere that has one, and the millimetres of a pixel that it gives."""
    measured = list[tuple[float, float]]()
    for sphere, circle in zip(given, used, strict=False):
        if sphere.diameter_mm is not None:
            # A circle may be corrected for its centre alone. Views of one object must agree in scale: noise of single
            # radii would turn them on their turntable.
            radius = circle.radius if is_radius_corrected(sphere.radius, circle) else sphere.radius
            size = _pixel_size(sphere.diameter_mm, replace(circle, radius=radius), camera)
            measured.append((sphere.diameter_mm, size))
    return measured


def _doubts_of_spheres(measured: Sequence[tuple[float, float]]) -> list[StageWarning]:
    """Return warnings of diameters that no chrome sphere has, and of scales that contradict each other.

    measured: diameter in millimetres, and millimetres of a pixel, of each sphere; not empty.
    """
    warnings = [
        _warning(f"`diameter_mm` {diameter:g} is {_comparison(diameter)}: give it in millimetres")
        for diameter, _ in measured
        if not MIN_DIAMETER_MM <= diameter <= MAX_DIAMETER_MM
    ]
    sizes = [size for _, size in measured]
    if max(sizes) > MAX_SCALE_RATIO * min(sizes):
        disagreement = f"the spheres contradict each other: {_joined_scales(sizes)} mm per pixel"
        warnings.append(_warning(f"{disagreement}; correct a `diameter_mm` or a radius"))
    return warnings


def _unlikely_diameters(diameters: Sequence[float], pixel_size: float, extent: float | None) -> list[StageWarning]:
    """Return a warning of diameters whose `pixel_size` makes the object larger or smaller than any."""
    if extent is None or MIN_OBJECT_MM <= pixel_size * extent <= MAX_OBJECT_MM:
        return []
    consequence = f"makes the object {length_text(pixel_size * extent)} large"
    return [_warning(f"`diameter_mm` {_joined_numbers(diameters)} {consequence}: correct it, or the sphere's circle")]


def _unlikely(
    pixel_size: float, spheres: Sequence[Sphere], camera: np.ndarray | None, extent: float | None
) -> list[StageWarning]:
    """Return a warning of a given `pixel_size` that makes the object or a chrome sphere larger or smaller than any."""
    diameters = [pixel_size / _pixel_size(1.0, sphere, camera) for sphere in spheres]
    length = None if extent is None else pixel_size * extent
    if length is not None and not MIN_OBJECT_MM <= length <= MAX_OBJECT_MM:
        consequence = f"the object {length_text(length)} large"
    elif wrong := [diameter for diameter in diameters if not MIN_DIAMETER_MM <= diameter <= MAX_DIAMETER_MM]:
        consequence = f"the chrome sphere {length_text(wrong[0])} in diameter"
    else:
        return []
    meant = [
        f"; if {unit} were meant, it is {factor * pixel_size:.3g}"
        for unit, factor in LIKELY_UNITS.items()
        if length is not None and USUAL_OBJECT_MM[0] <= factor * length <= USUAL_OBJECT_MM[1]
    ]
    message = f"`pixel_size` {pixel_size:.3g} makes {consequence}: give the millimetres that one pixel covers"
    return [_warning(message + "".join(meant))]


def _joined_numbers(numbers: Sequence[float]) -> str:
    return " and ".join(f"{number:g}" for number in numbers)


def _joined_scales(sizes: Sequence[float]) -> str:
    return " and ".join(f"{size:.3g}" for size in sizes)


def _warning(message: str) -> StageWarning:
    """Return a warning that costs no normal anything: the scale is that of depth and mesh."""
    return StageWarning(message, "scale")


def _comparison(diameter: float) -> str:
    return "that of a grain" if diameter < MIN_DIAMETER_MM else "more than any chrome sphere has"


def _pixel_size(diameter: float, sphere: Sphere, camera: np.ndarray | None) -> float:
    """Return the millimetres of a pixel at a sphere's centre, from its diameter in millimetres."""
    if camera is None:
        return diameter / (2.0 * sphere.radius)
    cone = Cone.from_ellipse(sphere.x, sphere.y, sphere.radius, camera)
    distance = diameter / (2.0 * cone.sine) * abs(float(cone.axis[2]))
    return distance / areal_focal_length(camera)
