"""Read a capture's frames, in order, as grey luma: of a video, or of a folder or glob of images in natural order.

Luma is full range (0 black, the type's largest value white), whatever the file's own range: 8-bit files give uint8,
deeper ones uint16. A video's luma plane is read directly, without conversion to colour.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol, Self

import numpy as np

from glint.storage.footage.copies import image_files
from glint.storage.footage.images import ImageSet
from glint.storage.footage.video import Video
from glint.storage.locations.location import Location

__all__ = ["Footage", "ImageSet", "Video", "open_footage"]


class Footage(Protocol):
    """The frames of a capture; use it in a `with`."""

    @property
    def uri(self) -> str:
        """Its address."""

    @property
    def codec(self) -> str:
        """The video's codec, or "images"."""

    @property
    def names(self) -> tuple[str, ...]:
        """The images' file names without folder; empty for a video."""

    @property
    def count(self) -> int:
        """The number of frames: for a video what the file states, 0 if it states nothing."""

    @property
    def bits(self) -> int:
        """8 (uint8) or 16 (uint16)."""

    @property
    def height(self) -> int:
        """Height of a frame in pixels."""

    @property
    def width(self) -> int:
        """Width of a frame in pixels."""

    @property
    def warnings(self) -> list[str]:
        """Damage met in the last complete pass over the frames, and copies that are left out."""

    def __enter__(self) -> Self:
        """Return itself."""

    def __exit__(self, *_: object) -> None:
        """Release what is open."""

    def frames(self, start: int = 0, step: int = 1) -> Iterator[np.ndarray]:
        """Yield luma (H, W) of frames start, start + step, ..

        Raises:
            InputError: a frame cannot be read, or differs from the first in size or depth.
        """

    def spread(self, count: int) -> list[np.ndarray]:
        """Return about `count` frames spread over all, luma (H, W), the first one first."""


def open_footage(frames: str | Path | Location) -> Footage:
    """Open a video, a folder of images or a glob of images without copies, local or in an object store.

    Raises:
        InputError: missing, unreadable, or too large; all images are there in two formats.
    """
    location = frames if isinstance(frames, Location) else Location.parse(frames)
    images = image_files(location)
    if images is None:
        return Video(location)
    return ImageSet(location.uri, images.kept, images.warnings)
