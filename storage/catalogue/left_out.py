"""What a catalogue made from folders leaves out, and why: said in words, since it may have been meant to be in it."""

from collections import Counter

from glint.storage.errors import InputError
from glint.storage.footage.images import SUFFIXES, UNDEVELOPED
from glint.storage.locations.input_files import list_folder
from glint.storage.locations.location import Location

VIDEO_SUFFIXES = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".mts", ".mxf")
SEARCHED_DEPTH = 4
"""Folders below an object's in which footage that lies too deep is looked for."""
ONE_FOLDER_EACH = "make one sub-folder per object with a video or a set of images in it"


def no_captures(location: Location, undeveloped: set[str]) -> InputError:
    """Return the error of a folder in which no object was found.

    undeveloped: suffixes of cameras' own formats in its sub-folders.
    """
    message = f"{location.uri} holds no captures"
    if undeveloped:
        return InputError(
            message, f"develop the {listed(undeveloped)} files to 16-bit TIFF or PNG, all with the same settings"
        )
    folders, files = list_folder(location)
    if footage := footage_text(files):
        return InputError(f"{message}: {footage} lie in it directly", "move them to a sub-folder, one for each object")
    deeper = [f"{folder.name}/{place}" for folder in folders if (place := deeper_footage(folder))]
    if deeper:
        return InputError(f"{message}: images or videos lie deeper, in {deeper[0]}", "give the folder above that one's")
    return InputError(message, ONE_FOLDER_EACH)


def reason_of_no_object(folder: Location, undeveloped: set[str]) -> str:
    """Return why a sub-folder is no object."""
    if undeveloped:
        return f"its {listed(undeveloped)} files are not read"
    if deeper := deeper_footage(folder):
        return f"its images or videos lie deeper, in {deeper}: move them up"
    return "no video and no set of images"


def undeveloped_suffixes(folder: Location) -> set[str]:
    """Return the suffixes of cameras' own formats in a folder and its sub-folders."""
    subfolders, files = list_folder(folder)
    below = [*files, *(file for subfolder in subfolders for file in list_folder(subfolder)[1])]
    return {file.suffix for file in below} & UNDEVELOPED


def deeper_footage(folder: Location, depth: int = 1) -> str:
    """Return the path below a folder of the first one that holds a video or several images; empty: none."""
    for subfolder in list_folder(folder)[0] if depth <= SEARCHED_DEPTH else ():
        counts = _footage_counts(list_folder(subfolder)[1])
        if counts["video"] or counts["image"] > 1:
            return subfolder.name
        if deeper := deeper_footage(subfolder, depth + 1):
            return f"{subfolder.name}/{deeper}"
    return ""


def footage_text(files: list[Location]) -> str:
    """Return in words how many videos and images there are; empty: none."""
    counts = _footage_counts(files)
    return " and ".join(f"{count} {kind}{'' if count == 1 else 's'}" for kind, count in counts.items() if count)


def other_images(count: int, chosen_count: int, pattern: str) -> str:
    """Return why images of one name are left out where more have another."""
    if count == chosen_count:
        return f"as many images as {pattern}: name the better ones as `frames`"
    images = "1 image that does" if count == 1 else f"{count} images that do"
    return f"{images} not match {pattern}: rename them alike if they are frames"


def listed(suffixes: set[str]) -> str:
    """Return suffixes as formats in a sentence."""
    return " and ".join(sorted(suffix.removeprefix(".").upper() for suffix in suffixes))


def _footage_counts(files: list[Location]) -> Counter[str]:
    counts = Counter[str](video=0, image=0)
    counts["video"] = sum(file.suffix in VIDEO_SUFFIXES for file in files)
    counts["image"] = sum(file.suffix in SUFFIXES for file in files)
    return counts
