"""Where a capture's workspace comes from: addresses and names alone, which is all that a flow's parameters hold."""

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path

from glint.storage.catalogue.loading import Catalogue, Object, load
from glint.storage.errors import InputError
from glint.storage.inputs.digests import file_stamp
from glint.storage.locations.location import Location
from glint.tasks.engine.capture_context import CaptureContext
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
        """OBJECT/CAPTURE."""
        return f"{self.object_id}/{self.capture_id}"

    def workspace(self) -> CaptureContext:
        """The capture's workspace.

        Raises:
            CatalogueError, InputError: the catalogue is unusable; KeyError: it has no such capture.
        """
        catalogue = load_catalogue(self.catalogue)
        return CaptureContext.of(catalogue, self.object_id, self.capture_id, self.store, self.run, self.rehash)


def load_catalogue(path: str | Path) -> Catalogue:
    """The catalogue, its parameters checked; read again only when the file has changed.

    Raises:
        CatalogueError: with everything that is wrong; InputError: it cannot be read.
    """
    place = Location.parse(path)
    try:
        changed = str(file_stamp(place))
    except InputError:
        changed = "missing"
    return _load(place.uri, changed)


@lru_cache(maxsize=4)
def _load(path: str, changed: str) -> Catalogue:
    return load(path, Parameters)


def chosen_captures(objects: Sequence[Object], only: Sequence[str] = ()) -> dict[str, list[str]]:
    """Ids of the captures to work on by object, in the catalogue's order.

    Raises:
        InputError: `only` names something that the catalogue has not.
    """
    every = {each.id: [capture.id for capture in each.captures] for each in objects}
    if not only:
        return every
    names = {f"{each}/{one}": (each, one) for each, captures in every.items() for one in captures}
    unknown = [name for name in only if name not in names and name not in every]
    if unknown:
        close = [name for name in names if name.endswith(f"/{unknown[0]}")]
        close += get_close_matches(unknown[0], [*every, *names], 1)
        raise InputError(
            f"the catalogue has no {', '.join(unknown)}",
            f"did you mean {close[0]}?" if close else "name OBJECT or OBJECT/CAPTURE as in the catalogue",
        )
    return {
        each: kept
        for each, captures in every.items()
        if (kept := [one for one in captures if each in only or f"{each}/{one}" in only])
    }
