"""Check the small files of captures before any frame is decoded, so that all mistakes in them are reported at once."""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from glint.storage.catalogue.models import Capture
from glint.storage.errors import GlintError, InputError, StoreError
from glint.storage.footage.copies import image_files
from glint.storage.inputs.lp_file import read_lights
from glint.storage.inputs.markup import check_markup

READERS = 16
"""Captures whose files are read side by side: an object store takes its time for each."""


def input_errors(captures: Iterable[Capture]) -> list[Sequence[GlintError]]:
    """Return what is wrong with the `.lp` file and the annotations of each capture, in order; empty: nothing.

    Images are listed, so that their names and number are compared with the rows; a video's length is not known yet. An
    object store that cannot be read is an error of the captures whose files it holds.
    """
    with ThreadPoolExecutor(READERS) as pool:
        return list(pool.map(_all_errors, captures))


def check_inputs(capture: Capture) -> None:
    """Check the `.lp` file and the annotations of a capture.

    Raises:
        InputError: with all that is wrong with them; StoreError: an object store cannot be read.
    """
    errors = _input_errors(capture)
    if errors:
        raise InputError("; ".join(error.message for error in errors), "; ".join(error.remedy for error in errors))


def _all_errors(capture: Capture) -> Sequence[GlintError]:
    try:
        return _input_errors(capture)
    except StoreError as error:
        return [error]


def _input_errors(capture: Capture) -> list[InputError]:
    if capture.lights is None and capture.markup is None:
        return []
    errors = list[InputError]()

    def attempt[T](read: Callable[[], T]) -> T | None:
        try:
            return read()
        except InputError as error:
            errors.append(error)
            return None

    images = attempt(partial(image_files, capture.frames))
    names = () if images is None else tuple(file.name for file in images.kept)
    if capture.lights is not None:
        attempt(partial(read_lights, capture.lights, names, skipped=() if images is None else images.skipped))
    if capture.markup is not None:
        attempt(partial(check_markup, capture.markup, len(names) or None))
    return errors
