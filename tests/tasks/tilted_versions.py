"""Versions whose normals are tilted by a known angle."""

from typing import Any

import numpy as np

from glint.storage.versions.repository import ObjectRepository

STAGES = ("survey", "labels", "depth")
REGION = {"x": 10, "y": 20, "width": 8, "height": 6}


def tilted(degrees: float, share: float = 1.0) -> np.ndarray:
    """Normals (6, 8, 3) towards the camera, a share of the columns turned about y; none in the first row."""
    normals = np.zeros((6, 8, 3), np.float32)
    normals[..., 2] = 1.0
    turned = np.arange(8) < round(8 * share)
    normals[:, turned] = np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees))
    normals[0] = np.nan
    return normals


def publish(
    repository: ObjectRepository,
    normals: np.ndarray,
    depth: np.ndarray,
    region: dict[str, int] = REGION,
    strength: float = 1.0,
    capture: str = "front",
    entry: dict[str, Any] | None = None,
) -> str:
    """A version of one capture."""
    about: dict[str, Any] = {"counts": {}, "warnings": [], "versions": {"glint": "1", "numpy": "2"}}
    survey = {**about, "region": region, "parameters": {}, "inputs": {"frames": f"digest of {region['x']}"}}
    key = f"{hash(normals.tobytes())}{depth[-1, -1]}{region}{strength}"
    repository.save(capture, "survey", f"{region}", {}, survey)
    labels = {**about, "parameters": {"strength": strength}}
    flat = {"provenance": np.zeros((6, 8), np.uint8), "confidence": np.zeros((6, 8), np.float32)}
    arrays = {"labels": np.zeros((2, 6, 8), np.uint8), "normals": normals, **flat}
    repository.save(capture, "labels", key, arrays, labels)
    repository.save(capture, "depth", key, {"depth": depth}, {**about, "unit": "mm", "parameters": {}})
    metadata = {} if entry is None else {"captures": {capture: {"entry": entry}}}
    return repository.publish([capture], metadata, STAGES).name


def depth(offset: float = 0.0) -> np.ndarray:
    values = np.add.outer(np.arange(6.0), np.arange(8.0)).astype(np.float32) + np.float32(offset)
    values[0] = np.nan
    return values
