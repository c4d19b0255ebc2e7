"""Values of all fields that can be edited, and damage to what was saved."""

from pathlib import Path
from typing import Any

import numpy as np

SPHERES = [{"x": 40.5, "y": 30.0, "radius": 12.25, "diameter_mm": 25.0}]
MARKS = [{"frame": 7, "x": 12.5, "y": 20.0, "kind": "true"}, {"frame": 9, "x": 3.0, "y": 4.0, "kind": "false"}]
VALUES: dict[str, Any] = {
    "spheres": SPHERES,
    "region": {"x": 1, "y": 2, "width": 30, "height": 20},
    "camera": {"matrix": [[900, 0, 30], [0, 900, 20], [0, 0, 1]]},
    "pixel_size": 0.25,
    "pose": {"turntable": 30.0},
    "marks": MARKS,
    "verdict": "usable",
}


def drawn_mask(right: int = 40) -> np.ndarray:
    mask = np.zeros((48, 64), bool)
    mask[10:30, 20:right] = True
    return mask


def damage_a_chunk(folder: Path, least_bytes: int) -> None:
    """Change a bit of the newest chunk of an object's folder that has at least so many bytes."""
    chunks = [path for path in (folder / "repo/chunks").iterdir() if path.stat().st_size >= least_bytes]
    newest = max(chunks, key=lambda path: path.stat().st_mtime_ns)
    data = bytearray(newest.read_bytes())
    data[len(data) // 2] ^= 4
    newest.write_bytes(data)
