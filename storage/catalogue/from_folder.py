"""A catalogue made from folders that follow the usual names.

FOLDER/<object>/ holds one capture, or one sub-folder per view. A capture is a video, or images that share a pattern
(img_1.png, img_2.png, ..), directly or in `frames/` or `images/`; beside it may lie mask.png or one other *mask.png,
lights.lp or one other *.lp, markup.json, truth/, and beside the views truth_model.ply. Several videos in one folder are
several captures; then <video>.mask.png, <video>.lp and <video>.markup.json belong to <video>.mp4.
"""

import re
from collections import defaultdict
from pathlib import Path, PurePosixPath
from typing import Any

from glint.storage.catalogue.models import MODEL, Catalogue, Object
from glint.storage.errors import InputError
from glint.storage.footage.images import SUFFIXES
from glint.storage.locations.input_files import Address, entries, locate
from glint.storage.locations.location import Location

VIDEOS = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".mts", ".mxf")
_BESIDE = re.compile(r"(.*[._-])?(mask|normals?([._-]map)?|depth|preview|reference|albedo)")
"""Images that are no frames, by their stem."""
_INSIDE = ("frames", "images")


def from_folder(folder: Address) -> Catalogue:
    """The catalogue of a folder, or a prefix of an object store, with one sub-folder per object.

    Raises:
        InputError: no such folder, or no footage in it; StoreError: the object store cannot be read.
    """
    place = locate(folder)
    taken: set[str] = set()
    objects = [found for each in entries(place)[0] if (found := object_of(each, taken)) is not None]
    if not objects:
        raise InputError(
            f"{place.uri} holds no captures", "make one sub-folder per object with a video or a set of images in it"
        )
    return Catalogue.model_validate({"schema": 1, "name": place.name or "captures", "objects": objects})


def object_of(place: Location, taken: set[str]) -> Object | None:
    """The object of one sub-folder, None if there is no footage in it; `taken` are ids that others have, and gets its.

    Raises:
        InputError: the folder cannot be read; StoreError: the object store cannot.
    """
    captures = _captures(place)
    if not captures:
        return None
    entry: dict[str, Any] = {"id": _id(place.name, taken), "captures": captures}
    model = next((file.uri for file in entries(place)[1] if file.name == "truth_model.ply"), None)
    return Object.model_validate(entry | ({"truth_model": model} if model else {}))


def _captures(place: Location) -> list[dict[str, Any]]:
    """Captures that lie in an object's folder itself, else those of its sub-folders."""
    taken = {MODEL}
    found = _footage(place)
    if found:
        return [_capture(place, name, frames, len(found) > 1, taken) for name, frames in found]
    captures = []
    for view in entries(place)[0]:
        found = _footage(view)
        several = len(found) > 1
        for name, frames in found:
            captures.append(_capture(view, f"{view.name}-{name}" if several else view.name, frames, several, taken))
    return captures


def _footage(place: Location) -> list[tuple[str, str]]:
    """Name and address of what can be footage in a folder: its videos, else its largest set of images."""
    folders, files = entries(place)
    videos = [file for file in files if _suffix(file) in VIDEOS]
    if videos:
        return [(_stem(file), file.uri) for file in videos]
    inside = [folder for name in _INSIDE for folder in folders if folder.name == name]
    for folder in (place, *inside):
        sets: dict[str, int] = defaultdict(int)
        for file in files if folder is place else entries(folder)[1]:
            if _suffix(file) in SUFFIXES and not _BESIDE.fullmatch(_stem(file).lower()):
                sets[re.sub(r"\d+", "[0-9]*", _literal(file.name))] += 1
        sets = {pattern: count for pattern, count in sets.items() if count > 1}
        if sets:
            pattern = max(sets, key=lambda each: (sets[each], each))
            # A pattern holds for a key's last part alone; a path is one pattern from its root.
            address = folder.uri if folder.local is None else _literal(folder.uri)
            return [("front", f"{address.rstrip('/')}/{pattern}")]
    return []


def _capture(place: Location, name: str, frames: str, several: bool, taken: set[str]) -> dict[str, Any]:
    folders, listed = entries(place)
    files = {file.name: file.uri for file in listed}
    stem = f"{Path(frames).stem}." if several else ""
    beside = {"mask": f"{stem}mask.png", "lights": f"{stem or 'lights.'}lp", "markup": f"{stem}markup.json"}
    capture: dict[str, Any] = {"id": _id("front" if name == "capture" else name, taken), "frames": frames}
    capture |= {key: files[file] for key, file in beside.items() if file in files}
    if not several:
        for key, pattern in (("mask", r"(.*[._-])?mask\.png"), ("lights", r".*\.lp")):
            found = [uri for file, uri in files.items() if re.fullmatch(pattern, file.lower())]
            if key not in capture and len(found) == 1:
                capture[key] = found[0]
        truth = [folder.uri for folder in folders if folder.name == "truth"]
        capture |= {"truth": truth[0]} if truth else {}
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


def _stem(file: Location) -> str:
    return PurePosixPath(file.name).stem


def _suffix(file: Location) -> str:
    return PurePosixPath(file.name).suffix.lower()
