"""Look at the head of an input before all of it is read: a wrong file of 100 GB is refused at once."""

from collections.abc import Sequence

from glint.storage.errors import InputError
from glint.storage.footage.images import MAX_IMAGE_BYTES, check_image_head
from glint.storage.footage.video import check_video_head
from glint.storage.locations.input_files import MAX_TEXT_BYTES, check_plain_file
from glint.storage.locations.location import Location

SINGLE_FILES = ("lights", "markup", "mask")
"""Keys of the catalogue that name one file, not a folder or a pattern."""


def check_head(key: str, files: Sequence[Location], sizes: Sequence[int], is_set: bool) -> None:
    """Refuse files that cannot be what a key of the catalogue (`frames`, `mask`, `lights`, `markup`) names.

    sizes: in bytes; is_set: the files are those of a folder or pattern.

    Raises:
        InputError: no video, no image, or too large for its kind.
    """
    if key == "frames" and not is_set:
        check_video_head(files[0])
        return
    path = files[0].local
    if path is not None:
        check_plain_file(path)
    limit = MAX_TEXT_BYTES if key in ("lights", "markup") else MAX_IMAGE_BYTES
    for file, size in zip(files, sizes, strict=True):
        if size > limit:
            raise InputError(f"{file.uri} has {size:,} bytes, more than {limit:,}", "check that it is the right file")
    if key in ("frames", "mask"):
        check_image_head(files[0])
