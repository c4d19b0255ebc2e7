"""A catalogue made from folders that follow the usual names.

FOLDER/<object>/ holds one capture, or one sub-folder per view. A capture is a video, or images that share a pattern
(img_1.png, img_2.png, ..), directly or in `frames/` or `images/`; beside it may lie mask.png or one other *mask.png,
lights.lp or one other *.lp, markup.json, truth/, and beside the views truth_model.ply. Several videos in one folder are
several captures; then <video>.mask.png, <video>.lp and <video>.markup.json belong to <video>.mp4.
"""

import re
from collections import defaultdict
from pathlib import Path
from typing import Any

from storage.catalogue_models import Catalogue
from storage.errors import InputError
from storage.footage_images import SUFFIXES
from storage.listing import natural_key

VIDEOS = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".mts", ".mxf")
_BESIDE = re.compile(r"(.*[._-])?(mask|normals?([._-]map)?|depth|preview|reference|albedo)")
"""Images that are no frames, by their stem."""
_INSIDE = ("frames", "images")


def from_folder(folder: str | Path) -> Catalogue:
    """The catalogue of a folder with one sub-folder per object.

    Raises:
        InputError: no such folder, or no footage in it.
    """
    folder = Path(folder).absolute()
    objects = []
    taken: set[str] = set()
    for place in _folders(folder):
        captures = _captures(place)
        if captures:
            entry: dict[str, Any] = {"id": _id(place.name, taken), "captures": captures}
            if (place / "truth_model.ply").is_file():
                entry["truth_model"] = str(place / "truth_model.ply")
            objects.append(entry)
    if not objects:
        raise InputError(
            f"{folder} holds no captures", "make one sub-folder per object with a video or a set of images in it"
        )
    return Catalogue.model_validate({"schema": 1, "name": folder.name or "captures", "objects": objects})


def _captures(place: Path) -> list[dict[str, Any]]:
    """Captures that lie in an object's folder itself, else those of its sub-folders."""
    taken: set[str] = set()
    found = _footage(place)
    if found:
        return [_capture(place, name, frames, len(found) > 1, taken) for name, frames in found]
    captures = []
    for view in _folders(place):
        found = _footage(view)
        several = len(found) > 1
        for name, frames in found:
            captures.append(_capture(view, f"{view.name}-{name}" if several else view.name, frames, several, taken))
    return captures


def _footage(place: Path) -> list[tuple[str, str]]:
    """Name and address of what can be footage in a folder: its videos, else its largest set of images."""
    files = _files(place)
    videos = [file for file in files if file.suffix.lower() in VIDEOS]
    if videos:
        return [(file.stem, str(file)) for file in videos]
    for folder in (place, *(place / name for name in _INSIDE)):
        sets: dict[str, list[Path]] = defaultdict(list)
        for file in _files(folder):
            if file.suffix.lower() in SUFFIXES and not _BESIDE.fullmatch(file.stem.lower()):
                sets[re.sub(r"\d+", "[0-9]*", _literal(file.name))].append(file)
        sets = {pattern: found for pattern, found in sets.items() if len(found) > 1}
        if sets:
            pattern = max(sets, key=lambda each: (len(sets[each]), each))
            return [("front", str(Path(_literal(str(folder))) / pattern))]
    return []


def _capture(place: Path, name: str, frames: str, several: bool, taken: set[str]) -> dict[str, Any]:
    stem = f"{Path(frames).stem}." if several else ""
    beside = {"mask": f"{stem}mask.png", "lights": f"{stem or 'lights.'}lp", "markup": f"{stem}markup.json"}
    capture: dict[str, Any] = {"id": _id("front" if name == "capture" else name, taken), "frames": frames}
    capture |= {key: str(place / file) for key, file in beside.items() if (place / file).is_file()}
    if not several:
        for key, pattern in (("mask", r"(.*[._-])?mask\.png"), ("lights", r".*\.lp")):
            found = [file for file in _files(place) if re.fullmatch(pattern, file.name.lower())]
            if key not in capture and len(found) == 1:
                capture[key] = str(found[0])
        if (place / "truth").is_dir():
            capture["truth"] = str(place / "truth")
    return capture


def _id(name: str, taken: set[str]) -> str:
    """The nearest name that can be an id and is not taken yet."""
    plain = re.sub(r"[^a-z0-9._-]+", "-", name.lower()).strip("-._")[:56] or "capture"
    chosen, number = plain, 1
    while chosen in taken:
        number += 1
        chosen = f"{plain}-{number}"
    taken.add(chosen)
    return chosen


def _literal(text: str) -> str:
    """Text for a pattern that stands for itself."""
    return re.sub(r"([*?[])", r"[\1]", text)


def _folders(place: Path) -> list[Path]:
    return _sorted(place, lambda path: path.is_dir())


def _files(place: Path) -> list[Path]:
    return _sorted(place, lambda path: path.is_file()) if place.is_dir() else []


def _sorted(place: Path, wanted: Any) -> list[Path]:
    try:
        found = [path for path in place.iterdir() if not path.name.startswith(".") and wanted(path)]
    except OSError as error:
        raise InputError(f"{place} cannot be read ({error.strerror})", "check the path and its permissions") from error
    return sorted(found, key=lambda path: (natural_key(path.name), path.name))
