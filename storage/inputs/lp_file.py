"""Read and write directions to the light as `.lp` files, the format of RTI (reflectance transformation imaging).

The first line holds the number of lights, each further line `name x y z`.
"""

from collections import Counter
from collections.abc import Collection, Sequence
from itertools import takewhile
from pathlib import Path
from unicodedata import normalize

import numpy as np

from glint.storage.catalogue.diagnostics import Diagnostic, raise_diagnostics, truncate_repr
from glint.storage.errors import InputError
from glint.storage.locations.input_files import MAX_TEXT_BYTES, Address, locate, read_bytes

MIN_LENGTH = 1e-6
"""Length below which a vector has no direction."""
MAX_NEGATED_SHARE = 0.8
"""Share of lights behind the object beyond which z is negated: no sweep is mostly behind it."""


def read_lights(
    address: Address, names: Sequence[str] = (), count: int | None = None, skipped: Collection[int] = ()
) -> np.ndarray:
    """Read directions to the light from an `.lp` file: float32 (T, 3), unit vectors, x right, y up, z to the camera.

    names: the frames' file names; rows are matched by name, or taken in order if none matches or frames share a name.
    count: number of frames, where frames have no names. skipped: places among all images of those that are no frames;
    rows in order may count them.

    Raises:
        InputError: malformed, NaN or zero directions, z negated, names of which some match, or a number of rows other
            than that of frames.
    """
    uri, first_line, stated_count, rows = _numbered_rows(address)
    row_names, directions = _parsed_rows(uri, first_line, stated_count, rows)
    frame_count = len(names) if names else count
    order = _rows_by_name(uri, row_names, names)
    if order is None and skipped and len(directions) == len(names) + len(skipped):
        order = [row for row in range(len(directions)) if row not in skipped]
    if order is None and frame_count is not None and frame_count != len(directions):
        without = f" without {len(skipped)} that are copies" if skipped else ""
        raise InputError(
            f"{uri} has {len(directions)} lights for {frame_count} frames{without}",
            "give one row per frame, in order, or rows with the images' file names",
        )
    lights = np.array(directions, np.float32).reshape(-1, 3)
    behind = int((lights[:, 2] < 0.0).sum())
    if behind > MAX_NEGATED_SHARE * len(lights):
        raise InputError(
            f"{behind} of {len(lights)} lights of {uri} lie behind the object (z < 0): z is reversed",
            "negate it: z points towards the camera",
        )
    return lights if order is None else lights[order]


def write_lights(path: Path, lights: np.ndarray, names: Sequence[str]) -> None:
    """Write directions (T, 3) as an `.lp` file with six decimals.

    Raises:
        ValueError: the number of names differs from that of lights.
    """
    rows = [f"{name} {x:.6f} {y:.6f} {z:.6f}" for name, (x, y, z) in zip(names, lights, strict=True)]
    path.write_text("\n".join([str(len(rows)), *rows]) + "\n", encoding="utf-8")


def _numbered_rows(address: Address) -> tuple[str, int, int, list[tuple[int, str]]]:
    """Return the file's URI, number and content of the line with the count, and the rows after it with their numbers.

    Raises:
        InputError: there is no count, or no row.
    """
    location = locate(address)
    lines = _decode(read_bytes(location, MAX_TEXT_BYTES)).splitlines()
    rows = [(number, line.strip()) for number, line in enumerate(lines, 1) if line.strip()]
    if not rows or not rows[0][1].isdecimal() or len(rows[0][1]) > 9:
        raise InputError(f"{location.uri}:1: this is not a count", "write the number of lights into the first line")
    if len(rows) == 1:
        raise InputError(f"{location.uri} holds no light", "give one row `name x y z` per frame")
    return location.uri, rows[0][0], int(rows[0][1]), rows[1:]


def _decode(data: bytes) -> str:
    """Decode UTF-8 or else the Western European code page in which RTIBuilder writes names on Windows."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", "replace")


def _parsed_rows(
    uri: str, first_line: int, stated_count: int, rows: Sequence[tuple[int, str]]
) -> tuple[list[str], list[list[float]]]:
    """Return the names and the unit directions of all rows.

    Raises:
        InputError: a row is malformed or has no direction, or there are not as many as stated in the first line.
    """
    parsed = [(number, line, *_parse_row(line)) for number, line in rows]
    if all(direction is None for *_, direction in parsed):
        # The lines of a file of another kind are not shown: the catalogue's author may not be allowed to read them.
        raise InputError(f"{uri} is not an .lp file", "write `name x y z` into each line after the first")
    has_column = _has_further_column([name for _, _, name, _ in parsed])
    diagnostics: list[Diagnostic] = []
    row_names: list[str] = []
    directions: list[list[float]] = []
    for number, line, name, direction in parsed:
        if direction is None:
            message, remedy = f"{truncate_repr(line)} is not a light", "write `name x y z`"
            diagnostics.append(Diagnostic(uri, number, message, remedy))
        elif not direction:
            message = f"{truncate_repr(line)} has no direction"
            remedy = "write a direction with finite length, or remove the frame"
            diagnostics.append(Diagnostic(uri, number, message, remedy))
        elif has_column or any(not number.isdecimal() for number in _last_numbers(name)):
            message = f"{truncate_repr(line)} has more than three numbers"
            remedy = "write `name x y z`, where a name of several words ends with a number only if it is a whole one"
            diagnostics.append(Diagnostic(uri, number, message, remedy))
        else:
            row_names.append(name)
            directions.append(direction)
    if stated_count != len(rows):
        message = f"the first line states {stated_count} lights, {len(rows)} follow"
        diagnostics.append(Diagnostic(uri, first_line, message, "correct the number or add the missing rows"))
    raise_diagnostics(diagnostics)
    return row_names, directions


def _parse_row(line: str) -> tuple[str, list[float] | None]:
    """Return a row's name and unit direction; None: malformed, empty: zero or not finite."""
    name, *parts = line.rsplit(None, 3)
    try:
        values = [float(part) for part in parts] if len(parts) == 3 else []
    except ValueError:
        values = []
    if not values:
        return name, None
    length = float(np.hypot.reduce(values))
    if not np.isfinite(length) or length < MIN_LENGTH:
        return name, []
    return name, [value / length for value in values]


def _has_further_column(names: Sequence[str]) -> bool:
    """Return whether all names are those of files, followed by numbers, as many in each row."""
    counts = {len(_last_numbers(name)) for name in names}
    return len(counts) == 1 and 0 not in counts and all(Path(name.split()[0]).suffix for name in names)


def _last_numbers(name: str) -> list[str]:
    """Return the numbers at the end of a name of several words, which may be those of further columns."""
    return list(takewhile(_is_number, reversed(name.split()[1:])))


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


def _rows_by_name(uri: str, row_names: Sequence[str], names: Sequence[str]) -> list[int] | None:
    """Return the row of each frame by its file name or, failing that, its name without suffix.

    None: no name matches, or frames of several folders have the same name.

    Raises:
        InputError: some match, but not all.
    """
    if not names or len({_base(name).lower() for name in names}) < len(names):
        return None
    for key in (lambda name: _base(name).lower(), _stem):
        images, counts = [key(name) for name in names], Counter(map(key, row_names))
        if all(counts[image] == 1 for image in images):
            rows = {key(name): row for row, name in enumerate(row_names)}
            return [rows[image] for image in images]
    matches = sum(counts[image] == 1 for image in images)
    if not counts.keys() & set(images):
        return None
    unknown = counts.keys() - set(images)
    faults = {
        "is no image": [name for name in row_names if _stem(name) in unknown],
        "has no row": [name for name in names if not counts[_stem(name)]],
        "has several rows": [name for name in names if counts[_stem(name)] > 1],
    }
    first = "; ".join(
        f"{truncate_repr(_base(unmatched[0]))} {fault}" for fault, unmatched in faults.items() if unmatched
    )
    raise InputError(
        f"{uri}: {matches} of {len(names)} names match; {first}",
        "correct the names, or replace all of them by names of no image to use the rows in order",
    )


def _stem(name: str) -> str:
    return _base(name).lower().rpartition(".")[0]


def _base(name: str) -> str:
    # macOS stores an accent in a name as a character of its own.
    return normalize("NFC", name.replace("\\", "/").rpartition("/")[2])
