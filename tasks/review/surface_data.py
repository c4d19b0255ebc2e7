"""Collect what the surface view shows of a version: an exported page's parts, and more that needs a server.

Whatever is read was verified by the store. A version never changes, so its data are kept by its snapshot.
"""

from functools import lru_cache
from typing import Any

import numpy as np

from glint.storage.errors import NotFoundError
from glint.storage.export.page.capture_data import CaptureData, Detail, capture_data
from glint.storage.export.page.model_data import model_data as packed_model
from glint.storage.export.page.packing import Part, octahedral, pack
from glint.storage.export.page.photographs import frame_photograph, spread_frames
from glint.storage.export.stored_capture import entry_of, ordered_stages
from glint.storage.versions.stage_results import WHOLE_OBJECT, StageResult
from glint.tasks.review.paper_result import PAPER_NEEDS, paper_normals
from glint.tasks.review.stored import VersionReference

SERVED = Detail(scale=1.0, frames=0, triangles=1_000_000)
"""Detail of what a server on the same machine sends: everything, a mesh within what a browser turns smoothly."""
MAX_OFFERED_FRAMES = 600
"""Frames that are offered beside the relit surface: one every 5 degrees of the hemisphere and denser."""
MAX_COUNT = 250
"""Greatest number that a count of candidates is packed as."""
PAPER = "paper"
"""Name of the normals that the literal paper's method gives."""
OTHER_NORMALS = {
    "initial": ("silhouette", "initial", "From the silhouette alone"),
    "winner": ("clusters", "winner", "Winner takes all"),
}
"""Other normals of a capture: stage, array, and what they are called."""


@lru_cache(maxsize=6)
def surface_data(version: VersionReference, capture: str) -> CaptureData:
    """Return facts and parts of a capture of a version.

    Raises:
        StoreError: no such object, version or capture, or a result is damaged.
    """
    repository = version.repository
    chosen = repository.version(version.name)
    if capture not in chosen.stages or capture == WHOLE_OBJECT:
        raise NotFoundError(
            f"{version.object_id} {version.name} has no capture {capture!r}", f"see `glint history {version.object_id}`"
        )
    results = repository.load_capture(capture, chosen.snapshot)
    stages = {stage: results[stage] for stage in ordered_stages(results, chosen)}
    data = capture_data(repository.location, capture, stages, entry_of(chosen, capture), SERVED)
    facts, parts = dict(data.facts), dict(data.parts)
    facts["fields"] = list(_fields(stages, parts))
    later = _later_fields(stages, parts)
    facts["fields"] += [{"part": PAPER, "name": "The paper's result (takes seconds)"}] if later else []
    if "clusters" in stages and "labels" in stages["labels"].arrays:
        _add_candidates(stages, facts, parts)
    facts["photographs"] = [*facts["photographs"], *_frames(stages)]
    facts["parts"] = {name: part.facts for name, part in parts.items()} | later
    for photograph in facts["photographs"]:
        facts["parts"].setdefault(photograph["part"], {"kind": "image/jpeg", "shape": facts["size"][::-1]})
    return CaptureData(facts, parts)


def surface_part(version: VersionReference, capture: str, name: str) -> Part:
    """Return a part by its name in the facts.

    Raises:
        NotFoundError: there is none; StoreError: as `surface_data`, or the frame is not in the cache.
    """
    data = surface_data(version, capture)
    if name in data.parts:
        return data.parts[name]
    if name.startswith(f"{PAPER}_") and name in data.facts["parts"]:
        mask = np.asarray(version.repository.load(capture, "mask", version.snapshot).read("mask"))
        made = dict[str, Part]()
        _add_field(PAPER, paper_normals(version, capture), mask, "", made)
        return made[name]
    if name not in data.facts["parts"]:
        raise NotFoundError(
            f"{version.object_id}/{capture} has no {name!r} to show in {version.name}",
            "see its facts for the names of parts",
        )
    repository = version.repository
    frames = repository.load(capture, "frames", version.snapshot)
    return frame_photograph(repository.location, frames, int(name.removeprefix("frame_")))


@lru_cache(maxsize=2)
def model_data(version: VersionReference) -> CaptureData | None:
    """Return facts and parts of a version's model, None where it has none.

    Raises:
        StoreError: no such object or version, or the model is damaged.
    """
    repository = version.repository
    if WHOLE_OBJECT not in repository.version(version.name).stages:
        return None
    merged = repository.load(WHOLE_OBJECT, "model", version.snapshot)
    return packed_model(merged, SERVED.triangles)


def _later_fields(stages: dict[str, StageResult], parts: dict[str, Part]) -> dict[str, dict[str, Any]]:
    """Return the facts of the parts that are computed on request; they are packed like other normals."""
    if "initial_normals" not in parts or not stages.keys() >= set(PAPER_NEEDS):
        return {}
    return {f"{PAPER}_{kind}": parts[f"initial_{kind}"].facts for kind in ("normals", "mask")}


def _fields(stages: dict[str, StageResult], parts: dict[str, Part]) -> Any:
    """Add other normals to the parts; yield part and name of each."""
    mask = stages["mask"].read("mask")
    for name, (stage, array, title) in OTHER_NORMALS.items():
        if stage in stages and array in stages[stage].arrays:
            yield _add_field(name, stages[stage].read(array), mask, title, parts)
    if "clusters" in stages and "normals" in stages["clusters"].arrays:
        for number, normals in enumerate(stages["clusters"].read("normals")):
            yield _add_field(f"candidate_{number}", normals, mask, f"Candidate {number + 1} by weight", parts)


def _add_field(name: str, normals: np.ndarray, mask: np.ndarray, title: str, parts: dict[str, Part]) -> dict[str, str]:
    known = mask & np.isfinite(normals).all(axis=-1)
    parts[f"{name}_normals"] = pack(octahedral(np.where(known[..., None], normals, np.nan)))
    parts[f"{name}_mask"] = pack(known.astype(np.uint8))
    return {"part": name, "name": title}


def _add_candidates(stages: dict[str, StageResult], facts: dict[str, Any], parts: dict[str, Part]) -> None:
    """Add the numbers of each pixel's candidates, and of those that were taken for the outer surface."""
    counts = stages["clusters"].read("count") > 0
    chosen = (stages["labels"].read("labels") == 1) & counts
    for name, values in (("candidates", counts), ("accepted", chosen)):
        parts[name] = pack(np.minimum(values.sum(axis=0), MAX_COUNT).astype(np.uint8))
    facts["candidates"] = {"largest": int(counts.sum(axis=0).max())}


def _frames(stages: dict[str, StageResult]) -> list[dict[str, Any]]:
    """Return the facts of frames with lights from all sides, which are read on request."""
    if "frames" not in stages or "lights" not in stages or "cache" not in stages["frames"].record:
        return []
    lights = stages["lights"].read("lights")
    return [
        {
            "part": f"frame_{frame}",
            "label": "frame",
            "frame": frame,
            "light": [round(float(part), 5) for part in lights[frame]],
        }
        for frame in spread_frames(lights, MAX_OFFERED_FRAMES)
    ]
