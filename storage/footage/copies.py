"""Copies among the images of a capture: files that hold the same picture as another one, and would count twice.

What a file holds decides, not its name: `img (2).png` may be a photograph of its own. Files of equal bytes are copies.
Where a name is that of a copy (`img copy.png`), or another file differs in its suffix alone, the pixels are compared,
since whoever stores a picture again changes its bytes.
"""

import re
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import PurePosixPath

import numpy as np

from glint.storage.errors import InputError
from glint.storage.footage.images import MAX_IMAGE_BYTES, SUFFIXES, decode_image
from glint.storage.locations.file_states import FileState, file_states, read_part
from glint.storage.locations.input_files import Address, expand, locate, read_bytes
from glint.storage.locations.location import Location
from glint.storage.locations.time_limit import within_time

_COPY_WORDS = "copy|copie|kopie|kopia|copia|cópia|kopi"
_COPY_NAME = re.compile(
    rf"(?P<before>.+?)[ _-]*(?:\(\d+\)|(?:{_COPY_WORDS})(?:[ _-]*\(?\d+\)?)?| \d+)"
    rf"|(?:{_COPY_WORDS}) (?:of|von|de|di|av) (?P<after>.+)",
    re.IGNORECASE,
)
"""Stems that file managers and browsers give to copies: `a (1)`, `a - Copy`, `a copy 2`, `a 2`, `Copy of a`."""
_PROBES, _PROBE_BYTES = 3, 4096
"""Parts of files of one size that are compared before all of it is read: files without compression have one size."""
_MAX_NAMED = 5
"""Copies that a message names."""


@dataclass(frozen=True, slots=True)
class ImageFiles:
    """listed: the images of a folder or pattern, in natural order; originals: of each copy among them the other one."""

    listed: tuple[Location, ...]
    originals: Mapping[Location, Location]

    @property
    def kept(self) -> tuple[Location, ...]:
        """The images without copies."""
        return tuple(file for file in self.listed if file not in self.originals)

    @property
    def skipped(self) -> tuple[int, ...]:
        """Places of the copies among all images, counted from 0."""
        return tuple(place for place, file in enumerate(self.listed) if file in self.originals)

    @property
    def warnings(self) -> list[str]:
        """A sentence that names the copies; none if there are none."""
        count = len(self.originals)
        if not count:
            return []
        pairs = [f"{copy.name} of {original.name}" for copy, original in self.originals.items()]
        named = ", ".join(pairs[:_MAX_NAMED]) + (f" and {count - _MAX_NAMED} more" if count > _MAX_NAMED else "")
        copies = "1 image is a copy of another" if count == 1 else f"{count} images are copies of others"
        return [f"{copies} and left out: {named}; remove what is not needed"]


def image_files(address: Address) -> ImageFiles | None:
    """Return the images of a folder or pattern, and which of them are copies; None for a single file.

    Raises:
        InputError: nothing there, an image cannot be looked at, or all images of one format are there in another, too.
    """
    location = locate(address)
    files = expand(location, SUFFIXES)
    if files is None:
        return None
    _check_one_format(files, location)
    return ImageFiles(tuple(files), within_time(lambda step: _originals(files), location.uri))


def _check_one_format(files: Sequence[Location], location: Location) -> None:
    """Refuse photographs that are all there in two formats, such as a JPEG and a TIFF of each.

    Raises:
        InputError: there are.
    """
    stems = defaultdict[str, set[str]](set)
    for file in files:
        stems[file.suffix].add(_stem(file))
    suffixes = sorted(stems, key=lambda suffix: -len(stems[suffix]))
    for number, suffix in enumerate(suffixes):
        for other in suffixes[number + 1 :]:
            if len(stems[other]) > 1 and stems[other] <= stems[suffix]:
                raise InputError(
                    f"{location.uri} holds {len(stems[other])} images twice, as {suffix} and as {other}",
                    f"name one kind as `frames`, such as *{suffix}",
                )


def _originals(files: Sequence[Location]) -> dict[Location, Location]:
    """Return the original of each copy; it is the file with the shortest name, and of those the first."""
    states = dict(zip(files, file_states(files), strict=True))
    groups = defaultdict[str, list[Location]](list)
    sizes = Counter(state.size for state in states.values())
    for file in _alike_in_part([file for file in files if sizes[states[file].size] > 1], states):
        groups[_content(file, states[file])].append(file)
    originals = dict[Location, Location]()
    for group in groups.values():
        original = min(group, key=lambda file: len(file.name))
        originals |= dict.fromkeys((file for file in group if file is not original), original)
    by_stem = defaultdict[tuple[Location, str], list[Location]](list)
    for file in files:
        by_stem[file.parent, _stem(file)].append(file)
    for file in files:
        matched = _COPY_NAME.fullmatch(_stem(file))
        named = by_stem.get((file.parent, matched["before"] or matched["after"]), []) if matched else []
        for original in (*named, *by_stem[file.parent, _stem(file)]):
            if file is original or file in originals or original in originals:
                continue
            if _same_pixels(original, states[original], file, states[file]):
                originals[file] = original
    return {file: originals[file] for file in files if file in originals}


def _alike_in_part(files: Sequence[Location], states: Mapping[Location, FileState]) -> list[Location]:
    """Return the files of which another one has the same size and the same bytes in some places."""
    parts = {file: (states[file].size, _parts(file, states[file].size)) for file in files}
    counts = Counter(parts.values())
    return [file for file in files if counts[parts[file]] > 1]


def _parts(file: Location, size: int) -> bytes:
    starts = (size * place // (_PROBES + 1) for place in range(1, _PROBES + 1))
    return b"".join(read_part(file, start, min(_PROBE_BYTES, size - start)) for start in starts)


@lru_cache(maxsize=4096)
def _content(file: Location, state: FileState) -> str:
    """Return a digest of a file's bytes; it is kept as long as the file stays as it is."""
    return sha256(read_bytes(file, MAX_IMAGE_BYTES)).hexdigest()


@lru_cache(maxsize=4096)
def _same_pixels(first: Location, first_state: FileState, second: Location, second_state: FileState) -> bool:
    """Return whether two images show the same; what cannot be decoded shows nothing, which its reading will report."""
    with suppress(InputError):
        image, other_image = (decode_image(read_bytes(file, MAX_IMAGE_BYTES), file.uri) for file in (first, second))
        return image.dtype == other_image.dtype and np.array_equal(image, other_image)
    return False


def _stem(file: Location) -> str:
    return PurePosixPath(file.name).stem.lower()
