"""The stages of a capture, in the order in which they run: the one declaration of the pipeline."""

from collections.abc import Callable, Mapping, Sequence

from glint.storage.footage.parts import HELD_BYTES
from glint.storage.versions.array_schema import ArraySchema
from glint.tasks.engine import parameters
from glint.tasks.engine.stage import CaptureSize, Stage
from glint.tasks.engine.stage_function import ImportedFunction
from glint.tasks.engine.tiles import TILE_BYTES

SHARDS_HELD = 3
"""Shards that are held while frames are decoded, compressed and written."""
TILES_HELD = 3
"""Times the bytes of a tile's frames that clustering a tile takes."""

LABELS_CANDIDATE_BYTES, MIN_LABELS_CANDIDATES = 300, 3
"""Bytes that labelling takes for each candidate of a pixel, most of them for the ties of its sheets (250 where every
pixel has all of its candidates), and the candidates below which what does not depend on them decides."""


def _function(stage: str) -> ImportedFunction:
    return ImportedFunction(f"glint.tasks.stages.{stage}", stage)


def _per_pixel(peak_bytes: int) -> Callable[[CaptureSize], int]:
    return lambda size: peak_bytes * size.region_pixels


def _labels_bytes(size: CaptureSize) -> int:
    return LABELS_CANDIDATE_BYTES * max(size.candidates, MIN_LABELS_CANDIDATES) * size.region_pixels


def _frames_bytes(size: CaptureSize) -> int:
    return HELD_BYTES + (SHARDS_HELD * 64 * size.region_pixels + 8 * size.frame_pixels) * size.pixel_bytes


STAGES = (
    Stage(
        "survey",
        _function("survey"),
        parameters.SurveyParameters,
        catalogue_keys=("spheres", "region", "pixel_size", "camera"),
        files=("frames", "mask", "lights"),
        progress_unit="frames",
        version=41,
    ),
    Stage(
        "frames",
        _function("frames"),
        parameters.FramesParameters,
        reads=("survey",),
        files=("frames",),
        arrays={
            "background": ArraySchema("HW", "u"),
            "peak": ArraySchema("HW", "u"),
            "clipped": ArraySchema("T2", "u"),
        },
        peak_bytes=_frames_bytes,
        progress_unit="frames",
        version=6,
    ),
    Stage(
        "lights",
        _function("lights"),
        parameters.LightsParameters,
        reads=("survey", "frames"),
        files=("lights",),
        arrays={
            "half_vectors": ArraySchema("T3", "f", "accepted"),
            "lights": ArraySchema("T3", "f", "accepted"),
            "reason": ArraySchema("T", "u"),
            "inverse_distance": ArraySchema("T", "f", "all"),
            "half_vector_sd": ArraySchema("HW", "f", "all"),
        },
        peak_bytes=_per_pixel(400),
        progress_unit="spheres",
        version=20,
    ),
    Stage(
        "mask",
        _function("mask"),
        parameters.MaskParameters,
        reads=("survey", "frames"),
        catalogue_keys=("region",),
        files=("mask",),
        arrays={"mask": ArraySchema("HW", "b"), "doubt": ArraySchema("HW", "f", "all")},
        peak_bytes=_per_pixel(300),
        version=10,
    ),
    Stage(
        "thresholds",
        _function("thresholds"),
        parameters.ThresholdsParameters,
        reads=("frames", "lights", "mask"),
        arrays={"thresholds": ArraySchema("HW", "u")},
        version=4,
    ),
    Stage(
        "markup",
        _function("markup"),
        parameters.MarkupParameters,
        reads=("survey", "frames", "lights", "mask", "thresholds"),
        files=("markup",),
        arrays={
            "pixels": ArraySchema("N2", "i"),
            "half_vectors": ArraySchema("N3", "f", "all"),
            "kind": ArraySchema("N", "i"),
        },
        version=5,
    ),
    Stage(
        "silhouette",
        _function("silhouette"),
        parameters.SilhouetteParameters,
        reads=("survey", "mask", "markup"),
        arrays={"rim": ArraySchema("HW", "b"), "initial": ArraySchema("HW3", "f", "mask")},
        peak_bytes=_per_pixel(350),
    ),
    Stage(
        "clusters",
        _function("clusters"),
        parameters.ClustersParameters,
        reads=("survey", "frames", "lights", "mask", "thresholds"),
        arrays={
            "normals": ArraySchema("KHW3", "f"),
            "weight": ArraySchema("KHW", "f"),
            "spread": ArraySchema("KHW", "f"),
            "count": ArraySchema("KHW", "i"),
            "observations": ArraySchema("HW", "i"),
            "winner": ArraySchema("HW3", "f", required=False),
            "shading": ArraySchema("KHW", "f"),
        },
        peak_bytes=lambda size: TILES_HELD * TILE_BYTES,
        progress_unit="tiles",
        parallel_tiles=True,
        version=7,
    ),
    Stage(
        "labels",
        _function("labels"),
        parameters.LabelsParameters,
        reads=("survey", "lights", "mask", "markup", "silhouette", "clusters"),
        catalogue_keys=("pose",),
        arrays={
            "labels": ArraySchema("KHW", "u"),
            "normals": ArraySchema("HW3", "f", "mask"),
            "provenance": ArraySchema("HW", "u"),
            "confidence": ArraySchema("HW", "f", "mask"),
            "evidence": ArraySchema("HW", "f", "mask"),
            "body_depth": ArraySchema("HW", "f", required=False),
        },
        peak_bytes=_labels_bytes,
        version=65,
    ),
    Stage(
        "depth",
        _function("depth"),
        parameters.DepthParameters,
        reads=("survey", "mask", "labels"),
        arrays={"depth": ArraySchema("HW", "f", "mask"), "provenance": ArraySchema("HW", "u")},
        peak_bytes=_per_pixel(400),
        version=10,
    ),
    Stage(
        "surface",
        _function("surface"),
        parameters.SurfaceParameters,
        reads=("survey", "lights", "mask", "labels", "depth"),
        peak_bytes=_per_pixel(450),
        version=4,
    ),
)
"""Stages in the order in which they run. The survey comes first, since everything is cropped by it."""
BY_NAME = {stage.name: stage for stage in STAGES}
NAMES = tuple(BY_NAME)
SCHEMAS: Mapping[str, Mapping[str, ArraySchema]] = {stage.name: stage.arrays for stage in STAGES}
"""Arrays that a version must hold, by stage."""


def stages_until(last: str) -> Sequence[Stage]:
    """Return the stages up to the named one."""
    return STAGES[: NAMES.index(last) + 1]


def warm_up() -> None:
    """Import the functions of all stages; a worker does it while it waits for its first task."""
    for stage in STAGES:
        if isinstance(stage.run, ImportedFunction):
            stage.run.load()
