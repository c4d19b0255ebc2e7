"""Known directions to the light, as the `.lp` files of the RTI community write them."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from glint.storage.catalogue.diagnostics import Problem, quoted, raise_all
from glint.storage.errors import InputError
from glint.storage.locations.input_files import MAX_TEXT, Address, locate, read_bytes


def read_lights(address: Address, names: Sequence[str] = (), count: int | None = None) -> np.ndarray:
    """Directions to the light from an `.lp` file: float32 (T, 3), unit, x right, y up, z to the camera.

    names: the frames' file names; the file's rows are matched by name if all are found there, else taken in order.
    count: how many frames there are, where frames have no names.

    Raises:
        InputError: malformed, NaN or zero directions, or not as many as frames.
    """
    location = locate(address)
    lines = read_bytes(location, MAX_TEXT).decode("utf-8-sig", "replace").splitlines()
    rows = [(number, line.strip()) for number, line in enumerate(lines, 1) if line.strip()]
    if not rows or not rows[0][1].isdecimal() or len(rows[0][1]) > 9:
        first = rows[0][1] if rows else ""
        raise InputError(f"{location.uri}:1: {quoted(first)} is no count", "the first line holds the number of lights")
    if len(rows) == 1:
        raise InputError(f"{location.uri} holds no light", "give one row `name x y z` per frame")
    claimed, problems = int(rows[0][1]), []
    found: list[tuple[str, list[float]]] = []
    for number, line in rows[1:]:
        parts = line.rsplit(None, 3)
        try:
            values = [float(part) for part in parts[1:]] if len(parts) == 4 else []
        except ValueError:
            values = []
        length = float(np.hypot.reduce(values)) if values else 0.0
        if not values:
            problems.append(Problem(location.uri, number, f"{quoted(line)} is no light", "write `name x y z`"))
        elif not np.isfinite(length) or length < 1e-6:
            remedy = "write a direction with finite length, or remove the frame"
            problems.append(Problem(location.uri, number, f"{quoted(line)} has no direction", remedy))
        else:
            found.append((parts[0], [value / length for value in values]))
    if claimed != len(rows) - 1:
        message = f"the first line says {claimed} lights, {len(rows) - 1} follow"
        problems.append(Problem(location.uri, rows[0][0], message, "correct the number or add the missing rows"))
    raise_all(problems)
    wanted = len(names) if names else count
    order = _order([name for name, _ in found], names)
    if order is None and wanted is not None and wanted != len(found):
        raise InputError(
            f"{location.uri} has {len(found)} lights for {wanted} frames",
            "give one row per frame, in order, or rows with the images' file names",
        )
    lights = np.array([direction for _, direction in found], np.float32).reshape(-1, 3)
    return lights if order is None else lights[order]


def write_lights(path: Path, lights: np.ndarray, names: Sequence[str]) -> None:
    """Write directions (T, 3) as an `.lp` file.

    Raises:
        ValueError: not one name per light.
    """
    rows = [f"{name} {x:.8f} {y:.8f} {z:.8f}" for name, (x, y, z) in zip(names, lights, strict=True)]
    path.write_text("\n".join([str(len(rows)), *rows]) + "\n", encoding="utf-8")


def _order(found: Sequence[str], names: Sequence[str]) -> list[int] | None:
    """For each frame's name the row with it, by whole name or, failing that, without suffix; None: no match."""
    for key in (lambda name: _base(name).lower(), lambda name: _base(name).lower().rpartition(".")[0]):
        rows = {key(name): row for row, name in enumerate(found)}
        if names and len(rows) == len(found) and all(key(name) in rows for name in names):
            return [rows[key(name)] for name in names]
    return None


def _base(name: str) -> str:
    return name.replace("\\", "/").rpartition("/")[2]
