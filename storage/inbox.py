"""Find the new and changed captures of an inbox: a folder, or a prefix of an object store, that people copy them into.

Each sub-folder is an object that follows the usual names (see `storage.catalogue.from_folder`), or holds a
catalogue.yaml of its own. It may name its own files alone, and those of folders that are allowed. What has been checked
is written into the store as a catalogue, so that nobody can change it before it runs: one catalogue for each sub-folder
that has its own, and one for all others, which keeps the finished ones too, for `glint verify --repair`.

The name, size and entity tag of a sub-folder's files are recorded once a run has finished it; it is skipped until one
of them changes. A sub-folder that failed is tried again.
"""

import json
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

import obstore
from pydantic import BaseModel

from glint.storage.catalogue.confinement import check_inside, confined
from glint.storage.catalogue.from_folder import MAX_NAME, object_from_folder
from glint.storage.catalogue.ids import former_id
from glint.storage.catalogue.loading import Catalogue, Object, load, write
from glint.storage.errors import GlintError, InputError, printable
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location
from glint.storage.seals import digest_of
from glint.storage.submissions import CATALOGUE, Submission, folder_names, list_submissions
from glint.storage.versions.repository import ObjectRepository, object_ids

FINISHED = "finished.json"
MAX_KEPT = 10_000
"""Objects of finished sub-folders that the common catalogue keeps: so many are read within seconds."""


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


@dataclass(slots=True)
class _Collected:
    """What a scan has collected so far: problems and empty sub-folders by name, the sub-folder of each object,
    catalogues with their objects, and the objects of sub-folders without a catalogue."""

    problems: dict[str, str]
    owners: dict[str, Submission]
    batches: list[Batch] = field(default_factory=list)
    loose: list[Object] = field(default_factory=list)
    empty: list[str] = field(default_factory=list)


def check_folder(folder: Location, name: str = "the inbox") -> None:
    """Check that a folder on this machine, which messages call by `name`, is one; prefixes exist with their first file.

    Raises:
        InputError: it is not.
    """
    if folder.local is not None and not folder.local.is_dir():
        raise InputError(f"{name} {folder.uri} is not a folder", "create it, or mount its disk")


class Inbox:
    """An inbox, and the record of its finished sub-folders, which the store keeps under STORE/inbox/."""

    def __init__(
        self,
        address: str,
        store: str,
        parameters_model: type[BaseModel] | None = None,
        allowed: Sequence[str] = (),
    ) -> None:
        """Open an inbox.

        parameters_model: checks the parameters of catalogues (see `storage.catalogue.loading`); allowed: folders or
        prefixes that sub-folders may name besides their own files.
        """
        self.location = Location.parse(address)
        self._allowed = [Location.parse(folder) for folder in allowed]
        self._store = Location.parse(store)
        self._records = self._store.child("inbox", digest_of(self.location.uri)[:16])
        self._parameters_model = parameters_model

    def submissions(self) -> tuple[list[Submission], dict[str, str]]:
        """List the sub-folders that hold files, by name, and the problems of those that cannot be listed.

        Raises:
            InputError: there is no such folder; StoreError: the inbox cannot be listed.
        """
        check_folder(self.location)
        return list_submissions(self.location, self._allowed)

    def scan(self, quiet_period: timedelta, now: datetime | None = None) -> InboxScan:
        """Collect the objects to run; sub-folders that changed within `quiet_period` wait for the next scan.

        Raises:
            InputError: there is no such folder; StoreError: inbox or store cannot be read.
        """
        latest = (now or datetime.now(UTC)) - quiet_period
        (submissions, problems), finished = self.submissions(), self._finished()
        changed, unchanged = list[Submission](), list[Submission]()
        for submission in submissions:
            is_finished = finished.get(submission.name) == submission.digest
            (unchanged if is_finished else changed).append(submission)
        # They are needed beside new objects only, and reading them takes a request for each.
        kept = self._finished_objects(unchanged) if changed else []
        collected = _Collected(problems, {item.id: submission for item, submission in kept})
        for submission in (submission for submission in changed if submission.changed <= latest):
            try:
                self._collect(submission, collected)
            except (GlintError, OSError) as error:
                # Whatever is wrong with one sub-folder must not stop the others; its name may be too long for a file.
                problems[submission.name] = str(error)
        if collected.loose:
            name = printable(self.location.name)[:MAX_NAME] or "inbox"
            objects = (*collected.loose, *(item for item, _ in kept[:MAX_KEPT]))
            together = Catalogue.model_validate({"schema": 1, "name": name, "objects": objects})
            address = self._write_catalogue(together, CATALOGUE)
            collected.batches.append(Batch(address, {item.id: collected.owners[item.id] for item in collected.loose}))
        waiting = tuple(submission.name for submission in changed if submission.changed > latest)
        return InboxScan(tuple(collected.batches), problems, waiting, tuple(collected.empty), len(unchanged))

    def _collect(self, submission: Submission, collected: "_Collected") -> None:
        """Add what a sub-folder holds to what was collected."""
        catalogue = self._catalogue(submission)
        objects = catalogue.objects if isinstance(catalogue, Catalogue) else catalogue
        ids = [item.id for item in objects]
        taken = [object_id for object_id in ids if object_id in collected.owners]
        if taken:
            owner = collected.owners[taken[0]].name
            collected.problems[submission.name] = f"contains the object {taken[0]}, as {owner} does: rename one of them"
        elif not objects:
            collected.empty.append(submission.name)
        else:
            if isinstance(catalogue, Catalogue):
                address = self._write_catalogue(catalogue, "catalogues", f"{submission.name}.yaml")
                collected.batches.append(Batch(address, dict.fromkeys(ids, submission)))
            else:
                collected.loose += objects
            collected.owners |= dict.fromkeys(ids, submission)

    def _finished_objects(self, submissions: Sequence[Submission]) -> list[tuple[Object, Submission]]:
        """Return the objects of sub-folders without a catalogue; those that can no longer be read are left out."""
        kept = dict[str, tuple[Object, Submission]]()
        for submission in (item for item in submissions if not item.has_catalogue):
            with suppress(GlintError, OSError):
                content = self._catalogue(submission)
                for item in () if isinstance(content, Catalogue) else content:
                    kept.setdefault(item.id, (item, submission))
        return list(kept.values())

    def finish(self, done: Collection[Submission]) -> None:
        """Record these sub-folders as finished, and drop the records of sub-folders that were removed.

        Raises:
            InputError: there is no such folder; StoreError: inbox or store cannot be read, or the store not written.
        """
        check_folder(self.location)
        names = frozenset(folder_names(self.location))
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

    def _catalogue(self, submission: Submission) -> Catalogue | tuple[Object, ...]:
        """Return the catalogue of a sub-folder, or the objects of one that has none."""
        folder = self.location.child(submission.name)
        folders = [folder, *self._allowed]
        # It may have become a link that leads out of the inbox since it was listed.
        check_inside(folder, [self.location, *self._allowed], "the sub-folder")
        if not submission.has_catalogue:
            item = self._object(folder)
            return () if item is None else confined([item], folders)
        catalogue = load(check_inside(folder.child(CATALOGUE), folders, "the catalogue"), self._parameters_model)
        return catalogue.model_copy(update={"objects": confined(catalogue.objects, folders)})

    def _object(self, folder: Location) -> Object | None:
        """Return the object of a sub-folder without a catalogue, with its former ids where the store has them."""
        item, former = object_from_folder(folder, set()), object_from_folder(folder, set(), former_id)
        return former if former is not None and former != item and self._is_stored(former) else item

    def _is_stored(self, item: Object) -> bool:
        """Return whether the store holds results of one of an object's captures under these ids."""
        if item.id not in object_ids(self._store):
            return False
        repository = ObjectRepository.open(self._store, item.id, create=False)
        names = repository.version_names()
        if not names:
            return not {capture.id for capture in item.captures}.isdisjoint(repository.captures())
        recorded = repository.version(names[-1]).metadata.get("captures", {})
        frames = ((recorded.get(capture.id, {}).get("entry", {}).get("frames"), capture) for capture in item.captures)
        return any(address == capture.frames for address, capture in frames)

    def _write_catalogue(self, catalogue: Catalogue, *names: str) -> str:
        """Write a catalogue whose files have been checked below the records; return its address."""
        target = self._records.child(*names)
        if target.local is not None:
            target.local.parent.mkdir(parents=True, exist_ok=True)
        write(catalogue, target)
        return target.uri
