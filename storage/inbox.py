"""Find the new and changed captures of an inbox: a folder, or a prefix of an object store, that people copy them into.

Each sub-folder is an object that follows the usual names (see `storage.catalogue.from_folder`), or holds a
catalogue.yaml of its own. The name, size and entity tag of its files are recorded once a run has finished it; it is
skipped until one of them changes. A sub-folder that failed is tried again.
"""

import json
from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import obstore
from pydantic import BaseModel

from glint.storage.catalogue.from_folder import object_from_folder
from glint.storage.catalogue.loading import Catalogue, Object, load, write
from glint.storage.errors import GlintError, InputError
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.storage.seals import digest_of

CATALOGUE = "catalogue.yaml"
FINISHED = "finished.json"


@dataclass(frozen=True, slots=True)
class Submission:
    """A sub-folder: the digest of its files' names, sizes and entity tags, the time of its last change, and whether it
    has a catalogue of its own."""

    name: str
    digest: str
    changed: datetime
    has_catalogue: bool


@dataclass(frozen=True, slots=True)
class Batch:
    """Objects to run from one catalogue; `submissions`: the sub-folder of each object, by object id."""

    catalogue: str
    submissions: dict[str, Submission]


@dataclass(frozen=True, slots=True)
class InboxScan:
    """The result of a scan. problems: error messages by sub-folder; waiting: sub-folders that changed too recently;
    empty: sub-folders without footage; unchanged: number of sub-folders that were finished before."""

    batches: tuple[Batch, ...]
    problems: dict[str, str]
    waiting: tuple[str, ...]
    empty: tuple[str, ...]
    unchanged: int


class Inbox:
    """An inbox, and the record of its finished sub-folders, which the store keeps under STORE/inbox/."""

    def __init__(self, address: str, store: str, parameters_model: type[BaseModel] | None = None) -> None:
        """Open an inbox; parameters_model: checks the parameters of catalogues (see `storage.catalogue.loading`)."""
        self.location = Location.parse(address)
        self._records = Location.parse(store).child("inbox", digest_of(self.location.uri)[:16])
        self._parameters_model = parameters_model

    def submissions(self) -> list[Submission]:
        """List all sub-folders that hold files, by name.

        Raises:
            InputError: there is no such folder; StoreError: the inbox cannot be listed.
        """
        if self.location.local is not None and not self.location.local.is_dir():
            raise InputError(f"the inbox {self.location.uri} is not a folder", "create it, or mount its disk")
        files: dict[str, list[tuple[str, int, str, datetime]]] = defaultdict(list)
        with store_errors(self.location.uri, "listing the inbox"):
            for meta in (meta for page in obstore.list(self.location.obstore()) for meta in page):
                name, _, path = meta["path"].partition("/")
                if path and not name.startswith("."):
                    tag = meta["e_tag"] or meta["last_modified"].isoformat()
                    files[name].append((path, meta["size"], tag, meta["last_modified"]))
        return [
            Submission(
                name,
                digest_of(sorted([path, size, tag] for path, size, tag, _ in entries)),
                max(changed for *_, changed in entries),
                any(path == CATALOGUE for path, *_ in entries),
            )
            for name, entries in sorted(files.items())
        ]

    def scan(self, quiet_period: timedelta, now: datetime | None = None) -> InboxScan:
        """Collect the objects to run now; sub-folders that changed within `quiet_period` wait for the next scan.

        Raises:
            InputError: there is no such folder; StoreError: inbox or store cannot be read.
        """
        latest = (now or datetime.now(UTC)) - quiet_period
        submissions, finished = self.submissions(), self._finished()
        changed = [submission for submission in submissions if finished.get(submission.name) != submission.digest]
        loose, batches, owners = list[Object](), list[Batch](), dict[str, Submission]()
        problems, empty = dict[str, str](), list[str]()
        for submission in (submission for submission in changed if submission.changed <= latest):
            try:
                objects = self._objects(submission)
            except GlintError as error:
                problems[submission.name] = str(error)
                continue
            ids = [item.id for item in objects]
            taken = [object_id for object_id in ids if object_id in owners]
            if taken:
                owner = owners[taken[0]].name
                problems[submission.name] = f"contains the object {taken[0]}, as {owner} does: rename one of them"
            elif not objects:
                empty.append(submission.name)
            else:
                owners |= dict.fromkeys(ids, submission)
                if submission.has_catalogue:
                    batches.append(Batch(self._catalogue(submission), dict.fromkeys(ids, submission)))
                else:
                    loose += objects
        if loose:
            batches.append(Batch(self._write_catalogue(loose), {item.id: owners[item.id] for item in loose}))
        waiting = tuple(submission.name for submission in changed if submission.changed > latest)
        return InboxScan(tuple(batches), problems, waiting, tuple(empty), len(submissions) - len(changed))

    def finish(self, done: Collection[Submission]) -> None:
        """Record these sub-folders as finished, and drop the records of sub-folders that were removed.

        Raises:
            StoreError: the store cannot be written.
        """
        names = {submission.name for submission in self.submissions()}
        finished = self._finished() | {submission.name: submission.digest for submission in done}
        kept = {name: digest for name, digest in sorted(finished.items()) if name in names}
        with store_errors(self._records.uri, "recording finished sub-folders"):
            data = json.dumps({"inbox": self.location.uri, "finished": kept}).encode()
            obstore.put(self._records.obstore(), FINISHED, data, use_multipart=False)

    def _finished(self) -> dict[str, str]:
        """Return the digests of finished sub-folders by name; none if the record is missing or damaged."""
        with store_errors(self._records.uri, "reading the record of finished sub-folders"):
            try:
                record = json.loads(bytes(obstore.get(self._records.obstore(), FINISHED).bytes()))["finished"]
            except (FileNotFoundError, ValueError, KeyError, TypeError):
                return {}
        return record if isinstance(record, dict) else {}

    def _objects(self, submission: Submission) -> tuple[Object, ...]:
        if submission.has_catalogue:
            return load(self._catalogue(submission), self._parameters_model).objects
        item = object_from_folder(self.location.child(submission.name), set())
        return () if item is None else (item,)

    def _catalogue(self, submission: Submission) -> str:
        return self.location.child(submission.name, CATALOGUE).uri

    def _write_catalogue(self, objects: Collection[Object]) -> str:
        """Write a catalogue of objects that have none of their own into the store; return its address."""
        fields = {"schema": 1, "name": self.location.name or "inbox", "objects": tuple(objects)}
        target = self._records.child(CATALOGUE)
        if target.local is not None:
            target.local.parent.mkdir(parents=True, exist_ok=True)
        write(Catalogue.model_validate(fields), target)
        return target.uri
