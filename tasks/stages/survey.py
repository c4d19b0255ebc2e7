"""Survey: what the video is, whether its camera stood still, where the spheres and the object are."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from glint.storage.footage.source import open_footage
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.stages.frame_parts import camera_warnings
from glint.tasks.stages.place_search import Places, PlaceSearch, first_places, useful_arrays
from glint.tasks.stages.scale import Scale, scale_of
from glint.tasks.stages.stabilization import Shake


def survey(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Find frame size and count, the camera's shake, spheres and region, where the catalogue does not give them.

    Raises:
        InputError: the video or the mask cannot be used; a sphere or region lies outside the frame; spheres and lights
            are both given; the camera's matrix is not in the frame's pixels.
        UnusableCapture: no sphere or no object can be found.
    """
    frames = inputs.file("frames")
    assert frames is not None
    with open_footage(frames) as footage:
        search = PlaceSearch.of(inputs, footage, progress)
        places, shake, stored = first_places(search)
        # Spheres that were found, or moved, are to be left out of the shake's measurement.
        if shake is None or (not shake.record["applied"] and _circles(places.spheres) != _circles(search.given)):
            shake = search.shake(places.region, places.spheres)
            if search.needs_sample and shake.record["applied"]:
                places = search.located(search.sampled(shake))
        region = places.region
        assert region is not None
        arrays = {} if stored is None else useful_arrays(stored, search, places, shake)
        if places.mask is not None:
            arrays["mask"] = places.mask[region.rows, region.columns]
        extent = float(max(region.width, region.height))
        scale = scale_of(inputs.field("pixel_size"), inputs.field("spheres"), places.spheres, search.camera, extent)
        return StageOutput(
            arrays={**arrays, **shake.arrays},
            record=_record(search, places, shake, scale),
            counts={"spheres": len(places.spheres)},
            warnings=[
                *places.warnings,
                *shake.warnings,
                *scale.warnings,
                *camera_warnings(inputs.field("camera"), search.size),
            ],
        )


def _record(search: PlaceSearch, places: Places, shake: Shake, scale: Scale) -> dict[str, Any]:
    """Return what is stored of a survey beside its arrays."""
    footage, inputs, camera = search.footage, search.inputs, search.camera
    assert places.region is not None
    return {
        "frame_size": [footage.width, footage.height],
        "frames_claimed": footage.count,
        "bits": footage.bits,
        "codec": footage.codec,
        "region": places.region.model_dump(),
        "spheres": [asdict(sphere) | {"found": search.seeks_spheres} for sphere in places.spheres],
        "given_spheres": [sphere.model_dump() for sphere in inputs.field("spheres")],
        "camera": None if camera is None else camera.tolist(),
        "stabilization": shake.record,
        "pixel_size": scale.pixel_size,
        "unit": scale.unit,
        "scene_change": places.scene_change,
    }


def _circles(spheres: Sequence[Sphere]) -> list[tuple[float, float, float]]:
    return [(sphere.x, sphere.y, sphere.radius) for sphere in spheres]
