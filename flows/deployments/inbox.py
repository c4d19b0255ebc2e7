"""What is new in an inbox: a folder, or a prefix of an object store, into which captures are put.

Each sub-folder is an object that follows the usual names (see `storage.catalogue_folder`), or holds a catalogue.yaml
of its own. What a run has finished is remembered by name, size and entity tag of the sub-folder's files, and left out
until one of them changes; what failed is tried again.
"""

import json
from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import obstore

from glint.storage.catalogue.from_folder import object_from_folder
from glint.storage.catalogue.loading import Catalogue, Object, write
from glint.storage.errors import InputError, StorageError
from glint.storage.inputs.digests import digest_of
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.tasks.engine.references import load_catalogue

CATALOGUE = "catalogue.yaml"


@dataclass(frozen=True, slots=True)
class Arrival:
    """A sub-folder: what tells its content from any other (`mark`), when it changed last, whether it has a catalogue of
    its own."""

    name: str
    mark: str
    changed: datetime
    has_catalogue: bool


@dataclass(frozen=True, slots=True)
class Batch:
    """Objects to run from one catalogue; `arrivals`: the sub-folder each of them came in."""

    catalogue: str
    arrivals: dict[str, Arrival]


@dataclass(frozen=True, slots=True)
class News:
    """What a look into the inbox gave. problems: what is wrong with a sub-folder; waiting: those that are still being
    written to; empty: those without footage; unchanged: how many were finished before."""

    batches: tuple[Batch, ...]
    problems: dict[str, str]
    waiting: tuple[str, ...]
    empty: tuple[str, ...]
    unchanged: int


class Inbox:
    """An inbox, and what the store remembers of it under STORE/inbox/."""

    def __init__(self, address: str, store: str) -> None:
        self.place = Location.parse(address)
        self._memory = Location.parse(store).child("inbox", digest_of(self.place.uri)[:16])

    def arrivals(self) -> list[Arrival]:
        """All sub-folders that hold files, by name.

        Raises:
            InputError: there is no such folder; StoreError: the inbox cannot be listed.
        """
        if self.place.local is not None and not self.place.local.is_dir():
            raise InputError(f"the inbox {self.place.uri} is no folder", "make it, or mount what should be there")
        files: dict[str, list[tuple[str, int, str, datetime]]] = defaultdict(list)
        with store_errors(self.place.uri, "looking into the inbox"):
            for found in (each for part in obstore.list(self.place.obstore()) for each in part):
                name, _, rest = found["path"].partition("/")
                if rest and not name.startswith("."):
                    tag = found["e_tag"] or found["last_modified"].isoformat()
                    files[name].append((rest, found["size"], tag, found["last_modified"]))
        return [
            Arrival(
                name,
                digest_of(sorted([rest, size, tag] for rest, size, tag, _ in of)),
                max(changed for *_, changed in of),
                any(rest == CATALOGUE for rest, *_ in of),
            )
            for name, of in sorted(files.items())
        ]

    def news(self, settled: timedelta, now: datetime | None = None) -> News:
        """What is to be run now; a sub-folder that changed less than `settled` ago is left for the next time.

        Raises:
            StoreError: inbox or store cannot be read.
        """
        latest = (now or datetime.now(UTC)) - settled
        arrivals, finished = self.arrivals(), self._finished()
        fresh = [each for each in arrivals if finished.get(each.name) != each.mark]
        ready = [each for each in fresh if each.changed <= latest]
        loose, batches, taken = list[Object](), list[Batch](), dict[str, Arrival]()
        problems, empty = dict[str, str](), list[str]()
        for each in ready:
            try:
                objects = self._objects(each)
            except StorageError as error:
                problems[each.name] = str(error)
                continue
            twice = [one.id for one in objects if one.id in taken]
            if twice:
                problems[each.name] = f"has the object {twice[0]}, as {taken[twice[0]].name} has: rename one of the two"
            elif not objects:
                empty.append(each.name)
            else:
                taken |= {one.id: each for one in objects}
                if each.has_catalogue:
                    batches.append(Batch(self._catalogue(each), {one.id: each for one in objects}))
                else:
                    loose += objects
        if loose:
            batches.append(Batch(self._together(loose), {one.id: taken[one.id] for one in loose}))
        waiting = tuple(each.name for each in fresh if each.changed > latest)
        return News(tuple(batches), problems, waiting, tuple(empty), len(arrivals) - len(fresh))

    def finish(self, done: Collection[Arrival]) -> None:
        """Remember what has been run, and forget what is gone.

        Raises:
            StoreError: the store cannot be written.
        """
        there = {each.name for each in self.arrivals()}
        finished = self._finished() | {each.name: each.mark for each in done}
        record = {name: mark for name, mark in sorted(finished.items()) if name in there}
        with store_errors(self._memory.uri, "remembering what was run"):
            data = json.dumps({"inbox": self.place.uri, "finished": record}).encode()
            obstore.put(self._memory.obstore(), "finished.json", data, use_multipart=False)

    def _finished(self) -> dict[str, str]:
        with store_errors(self._memory.uri, "reading what was run"):
            try:
                record = json.loads(bytes(obstore.get(self._memory.obstore(), "finished.json").bytes()))["finished"]
            except (FileNotFoundError, ValueError, KeyError, TypeError):
                return {}
        return record if isinstance(record, dict) else {}

    def _objects(self, arrival: Arrival) -> tuple[Object, ...]:
        if arrival.has_catalogue:
            return load_catalogue(self._catalogue(arrival)).objects
        found = object_from_folder(self.place.child(arrival.name), set())
        return () if found is None else (found,)

    def _catalogue(self, arrival: Arrival) -> str:
        return self.place.child(arrival.name, CATALOGUE).uri

    def _together(self, objects: Collection[Object]) -> str:
        """Write the catalogue of objects that have none of their own, into the store."""
        fields = {"schema": 1, "name": self.place.name or "inbox", "objects": tuple(objects)}
        target = self._memory.child(CATALOGUE)
        if target.local is not None:
            target.local.parent.mkdir(parents=True, exist_ok=True)
        write(Catalogue.model_validate(fields), target)
        return target.uri
