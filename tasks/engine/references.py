"""References to captures: addresses and names alone, which is all that a flow's parameters hold."""

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path

from glint.storage.catalogue.loading import Catalogue, Object, load
from glint.storage.errors import InputError
from glint.storage.locations.file_states import file_stamp
from glint.storage.locations.location import Location
from glint.tasks.engine.capture_context import CaptureContext, with_edits
from glint.tasks.engine.parameters import Parameters


@dataclass(frozen=True)
class CaptureReference:
    """A capture of a catalogue file, and the store and run that it is worked on in."""

    catalogue: str
    object_id: str
    capture_id: str
    store: str
    run: str
    rehash: bool = False

    def __str__(self) -> str:
        """Return OBJECT/CAPTURE."""
        return f"{self.object_id}/{self.capture_id}"

    def context(self) -> CaptureContext:
        """Return the capture's context, with the edits of the store over its entry in the catalogue.

        Raises:
            CatalogueError, InputError: the catalogue is unusable; KeyError: it has no such capture; StoreError: the
                store is.
        """
        catalogue = load_catalogue(self.catalogue)
        context = CaptureContext.of(catalogue, self.object_id, self.capture_id, self.store, self.run, self.rehash)
        (edited,) = with_edits([context])
        if edited.edits_damage is not None:
            raise edited.edits_damage
        return edited


def load_catalogue(path: str | Path) -> Catalogue:
    """Load a catalogue and check its parameters; it is read again only when the file has changed.

    Raises:
        CatalogueError: with all its errors; InputError: it cannot be read.
    """
    location = Location.parse(path)
    try:
        stamp = str(file_stamp(location))
    except InputError:
        stamp = "missing"
    return _load(location.uri, stamp)


@lru_cache(maxsize=4)
def _load(path: str, stamp: str) -> Catalogue:
    return load(path, Parameters)


def chosen_captures(objects: Sequence[Object], only: Sequence[str] = ()) -> dict[str, list[str]]:
    """Return the ids of the captures to process by object, in the catalogue's order.

    only: OBJECT or OBJECT/CAPTURE, by default all.

    Raises:
        InputError: `only` names something that the catalogue has not.
    """
    by_object = {item.id: [capture.id for capture in item.captures] for item in objects}
    if not only:
        return by_object
    names = {f"{object_id}/{capture}": None for object_id, captures in by_object.items() for capture in captures}
    unknown = [name for name in only if name not in names and name not in by_object]
    if unknown:
        close = [name for name in names if name.endswith(f"/{unknown[0]}")]
        # Of a known object, its captures are meant.
        own = [name for name in names if name.startswith(f"{unknown[0].partition('/')[0]}/")]
        close += get_close_matches(unknown[0], own, 1, 0.0) or get_close_matches(unknown[0], [*by_object, *names], 1)
        raise InputError(
            f"the catalogue has no {', '.join(unknown)}",
            f"did you mean {close[0]}?" if close else "name OBJECT or OBJECT/CAPTURE as in the catalogue",
        )
    wanted = set(only)
    chosen = {
        object_id: [capture for capture in captures if not wanted.isdisjoint((object_id, f"{object_id}/{capture}"))]
        for object_id, captures in by_object.items()
    }
    return {object_id: captures for object_id, captures in chosen.items() if captures}


def check_truth(path: str | Path, only: Sequence[str] = ()) -> None:
    """Check, before anything is computed, that a chosen capture of a catalogue has a ground truth.

    Raises:
        CatalogueError: the catalogue has errors; InputError: it cannot be read, or no chosen capture has one.
    """
    objects = load_catalogue(path).objects
    chosen = chosen_captures(objects, only)
    captures = [capture for item in objects for capture in item.captures if capture.id in chosen.get(item.id, ())]
    if not any(capture.truth for capture in captures):
        raise InputError(f"no capture of {path} names its ground truth", "add `truth: FOLDER` to it")
