"""Collect what the viewer shows of one capture: facts as JSON, arrays and photographs as packed parts."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from glint.storage.export.camera import camera_of
from glint.storage.export.image_files import PROVENANCE_PALETTE
from glint.storage.export.page.mesh_packing import pack_mesh
from glint.storage.export.page.packing import Part, confidence_codes, octahedral, pack, scaled_codes
from glint.storage.export.page.photographs import Photograph, photographs
from glint.storage.export.report import DEPTH_DIRECTION, code_names
from glint.storage.export.stored_capture import mesh_of
from glint.storage.locations.location import Location
from glint.storage.versions.stage_results import StageResult

MAX_LIGHT_DOTS = 400
"""Lights of accepted frames that the dial shows as dots."""


@dataclass(frozen=True, slots=True)
class Detail:
    """Level of detail of a capture: scale of the arrays' sides, number of frames, triangles of the mesh."""

    scale: float = 1.0
    frames: int = 40
    triangles: int = 160_000

    def reduced(self) -> "Detail":
        """Return about half of it."""
        return replace(
            self, scale=self.scale * 0.75, frames=max(4, self.frames // 2), triangles=max(5000, self.triangles // 2)
        )


@dataclass(frozen=True, slots=True)
class CaptureData:
    """Facts (JSON; `parts` in them tells how to unpack) and packed parts by name."""

    facts: dict[str, Any]
    parts: dict[str, Part]

    @property
    def size(self) -> int:
        """Bytes of all parts."""
        return sum(len(part.data) for part in self.parts.values())


def capture_data(
    location: Location,
    capture: str,
    stages: Mapping[str, StageResult],
    entry: Mapping[str, Any],
    detail: Detail,
) -> CaptureData:
    """Return what the page shows of a capture of which mask and labels are stored.

    stages: results by stage, in the order in which they ran; entry: of the catalogue.

    Raises:
        StoreError: a result is damaged.
    """
    mask, labels = stages["mask"].read("mask"), stages["labels"]
    camera = camera_of(stages, entry, None)
    record = stages["depth"].record if "depth" in stages else {}
    facts: dict[str, Any] = {
        "name": capture,
        "full_size": [mask.shape[1], mask.shape[0]],
        "pixel_size": camera.pixel_size if camera else record.get("pixel_size"),
        "is_perspective": camera is not None and camera.matrix is not None,
    }
    normals = _resized(labels.read("normals"), mask, detail.scale)
    shape = normals.shape[:2]
    small_mask = np.isfinite(normals).all(axis=-1)
    parts = {"mask": pack(small_mask.astype(np.uint8)), "normals": pack(octahedral(normals))}
    if "provenance" in labels.arrays:
        codes = np.where(mask, labels.read("provenance"), 0).astype(np.uint8)
        parts["provenance"] = pack(_nearest(codes, shape))
        facts["provenance"] = _provenance(codes[mask], code_names(labels.record.get("provenance")))
    if "confidence" in labels.arrays:
        confidence = _resized(labels.read("confidence"), mask, detail.scale)
        parts["confidence"] = pack(confidence_codes(confidence))
    if "depth" in stages and "depth" in stages["depth"].arrays:
        codes, (low, high) = scaled_codes(_resized(stages["depth"].read("depth"), mask, detail.scale))
        parts["depth"] = pack(codes)
        unit = str(record.get("unit") or "pixels")
        facts["depth"] = {"low": low, "high": high, "unit": unit, "direction": DEPTH_DIRECTION}
    if "lights" in stages:
        facts["lights"] = _light_dots(stages["lights"].read("lights"))
    facts["photographs"] = _photographs(photographs(location, stages, detail.frames, detail.scale), parts)
    if "surface" in stages and "surface.ply" in stages["surface"].files:
        facts["mesh"], mesh_parts = pack_mesh(mesh_of(stages["surface"], "surface.ply"), detail.triangles)
        parts |= mesh_parts
    facts["size"] = [shape[1], shape[0]]
    facts["parts"] = {name: part.facts for name, part in parts.items()}
    return CaptureData(facts, parts)


def _resized(values: np.ndarray, mask: np.ndarray, scale: float) -> np.ndarray:
    """Return float values (H, W) or unit vectors (H, W, 3) with sides multiplied by `scale` <= 1; NaN off the mask.

    A pixel of the result takes the mean of what is known in it, where that is half of it or more.
    """
    known = mask & np.isfinite(values if values.ndim == 2 else values.sum(axis=-1))
    chosen = known if values.ndim == 2 else known[..., None]
    if scale >= 1.0:
        return np.where(chosen, values, np.nan)
    size = tuple(max(1, round(side * scale)) for side in mask.shape[::-1])
    weight = cv2.resize(known.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    total = cv2.resize(np.where(chosen, values, 0).astype(np.float32), size, interpolation=cv2.INTER_AREA)
    with np.errstate(invalid="ignore", divide="ignore"):
        if values.ndim == 2:
            return np.where(weight >= 0.5, total / weight, np.nan)
        return np.where((weight >= 0.5)[..., None], total / np.linalg.norm(total, axis=-1, keepdims=True), np.nan)


def _nearest(codes: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    return np.asarray(cv2.resize(codes, shape[::-1], interpolation=cv2.INTER_NEAREST), np.uint8)


def _provenance(codes: np.ndarray, names: Mapping[int, str]) -> list[dict[str, Any]]:
    """Return code, name, colour and share of the provenance codes (N,) that the object's pixels have."""
    present, counts = np.unique(codes, return_counts=True)
    return [
        {
            "code": code,
            "name": names.get(code, f"code {code}"),
            "colour": PROVENANCE_PALETTE[min(code, len(PROVENANCE_PALETTE) - 1)].tolist(),
            "share": round(count / len(codes), 4),
        }
        for code, count in zip(present.tolist(), counts.tolist(), strict=True)
    ]


def _light_dots(lights: np.ndarray) -> list[list[float]]:
    known = lights[np.isfinite(lights).all(axis=-1)]
    chosen = known[:: max(1, -(-len(known) // MAX_LIGHT_DOTS))]
    return [[round(float(part), 3) for part in light[:2]] for light in chosen]


def _photographs(pictures: Any, parts: dict[str, Part]) -> list[dict[str, Any]]:
    """Add the pictures to the parts; return their facts."""
    facts = []
    picture: Photograph
    for number, picture in enumerate(pictures):
        name = f"photograph_{number}"
        parts[name] = picture.picture
        facts.append({"part": name, "label": picture.label, "frame": picture.frame, "light": picture.light})
    return facts
