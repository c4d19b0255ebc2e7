"""Make a catalogue from folders that follow the usual names.

FOLDER/<object>/ holds one capture, or one sub-folder per capture. A capture is a video, or images that share a pattern
(img_1.png, img_2.png, ..), directly or in a folder of FRAME_FOLDERS; beside it may lie mask.png or one other *mask.*,
lights.lp or one other *.lp, markup.json, truth/, and beside the captures truth_model.ply. An .lp file may also lie
among the images, or in a folder of LIGHTS_FOLDERS. Several videos in one folder are several captures; then
<video>.mask.png, <video>.lp and <video>.markup.json belong to <video>.mp4.
"""

import fnmatch
import re
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from typing import Any

from pydantic import ValidationError

from glint.storage.catalogue.ids import id_from_name
from glint.storage.catalogue.left_out import (
    VIDEO_SUFFIXES,
    footage_text,
    no_captures,
    other_images,
    reason_of_no_object,
    undeveloped_suffixes,
)
from glint.storage.catalogue.models import RESERVED_IDS, Catalogue, Object
from glint.storage.errors import InputError, one_line, printable
from glint.storage.footage.images import SUFFIXES
from glint.storage.locations.input_files import Address, list_folder, locate
from glint.storage.locations.location import Location

_NOT_FRAMES = re.compile(r"(.*[._-])?(mask|normals?([._-]map)?|depth|preview|reference|albedo)")
"""Images that are no frames, by their stem, and folders of such, by their name without an s at its end."""
FRAME_FOLDERS = ("frames", "images", "photos", "jpg", "jpeg", "jpeg-exports", "png", "tif", "tiff")
"""Folders of a capture's images, in the order in which they are looked for; RTIBuilder writes `jpeg-exports`."""
MAX_NAME = 200
"""Characters of a folder's name that a catalogue's keeps."""
LIGHTS_FOLDERS = ("assembly-files",)
"""Folders beside those of the images in which RTIBuilder writes `.lp` files."""
OTHER_LIGHTS = frozenset(("light_directions.txt", "light_positions.txt", "lights.txt"))
"""Files of lights that other programs and data sets have, in other forms than `.lp`."""
Naming = Callable[[str], str]
"""The id that a name becomes."""
LeaveOut = Callable[[str, str], None]
"""Called with the name of what is left out, and the reason."""


def _silently(name: str, reason: str) -> None:
    """Leave something out without a word."""


def from_folder(folder: Address, leave_out: LeaveOut = _silently) -> Catalogue:
    """Make the catalogue of a folder, or a prefix of an object store, with one sub-folder per object.

    leave_out: called for each sub-folder that is no object, and for files that a capture might have been meant to have.

    Raises:
        InputError: no such folder, or no video or images in it; StoreError: the object store cannot be read.
    """
    location = locate(folder)
    taken: set[str] = set()
    objects, undeveloped = list[Object](), set[str]()
    folders, files = list_folder(location)
    for subfolder in folders:
        item = object_from_folder(subfolder, taken, leave_out=leave_out)
        if item is not None:
            objects.append(item)
            continue
        suffixes = undeveloped_suffixes(subfolder)
        undeveloped |= suffixes
        leave_out(subfolder.name, reason_of_no_object(subfolder, suffixes))
    if not objects:
        raise no_captures(location, undeveloped)
    if footage := footage_text(files):
        leave_out(location.name, f"{footage} beside the sub-folders: move each object's to a sub-folder")
    return Catalogue.model_validate(
        {"schema": 1, "name": printable(location.name)[:MAX_NAME] or "captures", "objects": objects}
    )


def object_from_folder(
    folder: Location, taken: set[str], naming: Naming = id_from_name, leave_out: LeaveOut = _silently
) -> Object | None:
    """Make the object of one sub-folder, None if there is no video or images in it.

    taken: ids that other objects have; the object's is added. naming: makes its id and those of its captures.
    leave_out: called for files that a capture might have been meant to have.

    Raises:
        InputError: the folder cannot be read, or a name in it is no text; StoreError: the object store cannot.
    """
    captures = _captures(folder, naming, leave_out)
    if not captures:
        return None
    entry: dict[str, Any] = {"id": _new_id(naming(folder.name), taken), "captures": captures}
    model = next((file.uri for file in list_folder(folder)[1] if file.name == "truth_model.ply"), None)
    try:
        return Object.model_validate(entry | ({"truth_model": model} if model else {}))
    except ValidationError as error:
        raise InputError(
            f"{folder.uri} cannot be an object ({one_line(error)})", "rename the folder or the files in it"
        ) from error


def _captures(folder: Location, naming: Naming, leave_out: LeaveOut) -> list[dict[str, Any]]:
    """Return the captures in an object's folder itself, else those of its sub-folders."""
    taken = set(RESERVED_IDS)

    def capture(place: Location, name: str, frames: str, is_shared: bool) -> dict[str, Any]:
        capture_id = _new_id(naming("front" if name == "capture" else name), taken)
        return {"id": capture_id, "frames": frames} | _beside(place, frames, is_shared, leave_out)

    footage = _footage(folder, leave_out)
    if footage:
        return [capture(folder, name, frames, len(footage) > 1) for name, frames in footage]
    captures = []
    for subfolder in list_folder(folder)[0]:
        if _NOT_FRAMES.fullmatch(subfolder.name.lower().removesuffix("s")):
            continue
        footage = _footage(subfolder, leave_out)
        is_shared = len(footage) > 1
        for name, frames in footage:
            capture_name = f"{subfolder.name}-{name}" if is_shared else subfolder.name
            captures.append(capture(subfolder, capture_name, frames, is_shared))
    return captures


def _footage(folder: Location, leave_out: LeaveOut) -> list[tuple[str, str]]:
    """Return name and address of a folder's videos, else of its largest set of images."""
    folders, files = list_folder(folder)
    videos = [file for file in files if file.suffix in VIDEO_SUFFIXES]
    if videos:
        frames = [file for file in files if _is_frame(file)]
        if len(frames) > 1:
            leave_out(folder.name, f"{footage_text(frames)} beside a video, which is taken for the capture")
        return [(_stem(file), file.uri) for file in videos]
    for image_folder in (folder, *_named(folders, FRAME_FOLDERS)):
        sets: dict[str, int] = defaultdict(int)
        for file in files if image_folder is folder else list_folder(image_folder)[1]:
            if _is_frame(file):
                sets[re.sub(r"\d+", "[0-9]*", _escape(file.name))] += 1
        if max(sets.values(), default=0) > 1:
            pattern = max(sets, key=lambda pattern: (sets[pattern], pattern))
            for other in sorted(sets.keys() - {pattern}):
                # A name with more after its number, as that of a copy, matches too, and is read.
                if not fnmatch.fnmatchcase(re.sub(r"\[0-9\]\*", "0", other), pattern):
                    leave_out(f"{folder.name}/{other}", other_images(sets[other], sets[pattern], pattern))
            # In an object store only the last part of the key is a pattern; of a path all is, so it is escaped.
            address = image_folder.uri if image_folder.local is None else _escape(image_folder.uri)
            return [("front", f"{address.rstrip('/')}/{pattern}")]
    return []


def _beside(folder: Location, frames: str, is_shared: bool, leave_out: LeaveOut) -> dict[str, Any]:
    """Return a capture's files beside its frames; `is_shared`: the folder has several captures."""
    subfolders, listed = list_folder(folder)
    files = {file.name: file.uri for file in listed}
    stem = f"{Path(frames).stem}." if is_shared else ""
    beside = {"mask": f"{stem}mask.png", "lights": f"{stem or 'lights.'}lp", "markup": f"{stem}markup.json"}
    capture: dict[str, Any] = {key: files[file] for key, file in beside.items() if file in files}
    if not is_shared:
        for key, is_one in (("mask", _is_mask), ("lights", _is_lights)):
            if key not in capture:
                capture |= _only_entry(key, [file for file in listed if is_one(file)], leave_out)
        if "lights" not in capture:
            within = _named(subfolders, (*FRAME_FOLDERS, *LIGHTS_FOLDERS))
            candidates = [file for subfolder in within for file in list_folder(subfolder)[1] if _is_lights(file)]
            capture |= _only_entry("lights", candidates, leave_out)
        for file in listed if "lights" not in capture else ():
            if file.name.lower() in OTHER_LIGHTS:
                leave_out(f"{folder.name}/{file.name}", "only .lp files are read as lights: write them as `name x y z`")
        truth = [subfolder.uri for subfolder in subfolders if subfolder.name == "truth"]
        capture |= {"truth": truth[0]} if truth else {}
    return capture


def _only_entry(key: str, files: list[Location], leave_out: LeaveOut) -> dict[str, str]:
    """Return the entry of the only file; it is empty where there is none, or where several are left out."""
    if len(files) > 1:
        names = ", ".join(f"{file.parent.name}/{file.name}" for file in files)
        leave_out(names, f"any of them could be `{key}`: name one in the catalogue")
    return {key: files[0].uri} if len(files) == 1 else {}


def _is_frame(file: Location) -> bool:
    return file.suffix in SUFFIXES and _NOT_FRAMES.fullmatch(_stem(file).lower()) is None


def _is_mask(file: Location) -> bool:
    return file.suffix in SUFFIXES and re.fullmatch(r"(.*[._-])?mask", _stem(file).lower()) is not None


def _is_lights(file: Location) -> bool:
    return file.suffix == ".lp"


def _named(folders: list[Location], names: tuple[str, ...]) -> list[Location]:
    """Return the folders that have one of these names, in the names' order; case does not matter."""
    return [folder for name in names for folder in folders if folder.name.lower() == name]


def _new_id(plain: str, taken: set[str]) -> str:
    """Return this id, with a number if it is taken, and take it."""
    chosen, number = plain, 1
    while chosen in taken:
        number += 1
        chosen = f"{plain}-{number}"
    taken.add(chosen)
    return chosen


def _escape(text: str) -> str:
    """Return a glob pattern that matches exactly this text."""
    return re.sub(r"([*?[])", r"[\1]", text)


def _stem(file: Location) -> str:
    return PurePosixPath(file.name).stem
