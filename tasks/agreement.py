"""Agreement of one object's captures: by all their scales it has about the same size, and so it is with their spheres.

Views of an object differ by its proportions and by how near the camera was; by more than that, a scale is in another
unit. A stage of one capture knows nothing of other captures, so scales and spheres (`sphere_agreement`) are compared by
checks and runs.
"""

from collections.abc import Mapping, Sequence
from statistics import median

from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.model.model_key import wants_model
from glint.tasks.sphere_agreement import CaptureSpheres, sphere_warnings
from glint.tasks.stages.capture_geometry import CaptureGeometry, load_geometry
from glint.tasks.stages.scale import length_text

MAX_VIEW_RATIO = 6.0
"""Ratio of an object's extents in two views beyond which a scale is wrong: a bottle from the side and from above has
four."""


def agreement_warnings(
    surveyed: Sequence[CaptureContext], spheres: Mapping[str, CaptureSpheres]
) -> dict[str, list[StageWarning]]:
    """Return warnings, by capture id, of spheres and scales that the object's other captures contradict.

    surveyed: captures of one object; spheres: theirs, of `surveyed_spheres`.

    Raises:
        StoreError: a capture has not been surveyed.
    """
    warnings = sphere_warnings(spheres)
    for name, of_scale in scale_warnings(surveyed).items():
        warnings.setdefault(name, []).extend(of_scale)
    return warnings


def scale_warnings(contexts: Sequence[CaptureContext]) -> dict[str, list[StageWarning]]:
    """Return warnings, by capture id, of scales by which an object has another size than by its other captures'.

    contexts: surveyed captures of one object.

    Raises:
        StoreError: a capture has not been surveyed.
    """
    geometries = {context.capture.id: load_geometry(context) for context in contexts}
    return contradicting_scales(geometries) | (unknown_scales(geometries) if wants_model(contexts) else {})


def contradicting_scales(captures: Mapping[str, CaptureGeometry]) -> dict[str, list[StageWarning]]:
    """Return warnings, by capture, of scales by which the object is far larger or smaller than by the others."""
    lengths = {
        name: geometry.pixel_size * max(geometry.region.width, geometry.region.height)
        for name, geometry in captures.items()
        if geometry.pixel_size
    }
    warnings = dict[str, list[StageWarning]]()
    for name, length in lengths.items():
        other_lengths = [other for other_name, other in lengths.items() if other_name != name]
        if not other_lengths:
            continue
        usual = median(other_lengths)
        if max(length, usual) > MAX_VIEW_RATIO * min(length, usual):
            captures_of = "the other capture's" if len(other_lengths) == 1 else "those of the other captures"
            message = (
                f"by its scale, {captures[name].pixel_size:.3g} mm per pixel, the object is {length_text(length)}"
                f" large, by {captures_of} {length_text(usual)}: correct `pixel_size` or `diameter_mm` where it is"
                " wrong"
            )
            warnings[name] = [StageWarning(message, "scale")]
    return warnings


def unknown_scales(captures: Mapping[str, CaptureGeometry]) -> dict[str, list[StageWarning]]:
    """Return warnings, by capture, of scales that are not known while those of others are: no model joins them."""
    unknown = [name for name, geometry in captures.items() if not geometry.pixel_size]
    if len(unknown) == len(captures):
        return {}
    message = (
        "its scale is not known, but that of other views is: give `pixel_size`, or a sphere's `diameter_mm`, for all"
        " views or for none, since no model is made of both"
    )
    return {name: [StageWarning(message, "scale")] for name in unknown}
