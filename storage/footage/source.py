"""Frames of a capture, one after the other, as grey luma: a video, or a folder or glob of images in natural order.

Luma is full range (0 black, the type's largest value white), whatever the file's own range: 8-bit files give uint8,
deeper ones uint16. A video's luma plane is taken as it is, without the way through colour.
"""

from pathlib import Path

from glint.storage.footage.images import SUFFIXES, ImageSet
from glint.storage.footage.video import Video
from glint.storage.locations.input_files import expand
from glint.storage.locations.location import Location

__all__ = ["Footage", "ImageSet", "Video", "open_footage"]

Footage = Video | ImageSet


def open_footage(frames: str | Path | Location) -> Footage:
    """Open a video, a folder of images or a glob of images, local or in an object store; use it in a `with`.

    Raises:
        InputError: nothing there, unreadable, or of an absurd size.
    """
    location = frames if isinstance(frames, Location) else Location.parse(frames)
    files = expand(location, SUFFIXES)
    if files is None:
        return Video(location)
    return ImageSet(location.uri, files)
