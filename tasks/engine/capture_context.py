"""What a stage works on: one capture of one object in one store, with its parameters; small enough to send anywhere."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from typing import Any

from glint.storage.catalogue.loading import Capture, Catalogue, parameters_for
from glint.storage.edits.overlay import EditsUsed, edited_entries
from glint.storage.errors import DamagedError, InputError
from glint.storage.inputs.digests import content_digest, input_stamps
from glint.storage.locations.location import Location
from glint.storage.seals import digest_of
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import StageResult
from glint.tasks.engine.parameters import Parameters, with_current_names

INPUTS = ("frames", "lights", "mask", "markup")
"""Keys of a capture that name files."""

OPEN_REPOSITORIES = 8
"""Objects whose repository a process keeps open."""


@dataclass(frozen=True)
class CaptureContext:
    """A capture in a store.

    store: address of the store.
    object_id: the object that the capture is of.
    capture: its entry in the catalogue, with the edits of the store where they are applied, see `with_edits`.
    parameters: of all stages, merged.
    run: name of the run.
    rehash: whether digests of the files are computed anew, not remembered.
    edits: what a person has edited of the entry; None where nothing is, or edits are not applied.
    ref: the version that its results are loaded from, `work` for the newest ones.
    catalogue_entry: the entry without these edits, None where there are none.
    edits_damage: why its edits cannot be read; `capture` is the catalogue's entry then, and no key follows from it.
    """

    store: str
    object_id: str
    capture: Capture
    parameters: Parameters
    run: str = ""
    rehash: bool = False
    edits: EditsUsed | None = None
    ref: str = "work"
    catalogue_entry: Capture | None = None
    edits_damage: DamagedError | None = None

    @classmethod
    def of(
        cls, catalogue: Catalogue, object_id: str, capture_id: str, store: str, run: str = "", rehash: bool = False
    ) -> "CaptureContext":
        """Return the context of a catalogue's capture, its parameters merged."""
        capture = catalogue.object(object_id).capture(capture_id)
        merged = parameters_for(catalogue, object_id, capture_id, with_current_names)
        return cls(store, object_id, capture, Parameters.model_validate(merged), run, rehash)

    @property
    def name(self) -> str:
        """OBJECT/CAPTURE, as on the command line."""
        return f"{self.object_id}/{self.capture.id}"

    @property
    def location(self) -> Location:
        """The store."""
        return Location.parse(self.store)

    @property
    def repository(self) -> ObjectRepository:
        """The object's results; kept open in this process for the next stage."""
        return _repository(self.store, self.object_id)

    def load(self, stage: str) -> StageResult:
        """Return what a stage saved.

        Raises:
            StoreError: it has saved nothing.
        """
        return self.repository.load(self.capture.id, stage, self.ref)

    def file(self, key: str) -> str | None:
        """Return the address that the catalogue gives under a key (`frames`, `mask`, ..), None where it gives none."""
        address: str | None = getattr(self.capture, key)
        return address

    def digest(self, key: str) -> str | None:
        """Return the content digest of the file or files under a key, None where the catalogue gives none.

        Raises:
            InputError: they cannot be read.
        """
        return None if self.file(key) is None else self._digests[key]

    def entry_digest(self, keys: Collection[str]) -> str:
        """Return the digest of what the catalogue and the edits say of the capture under these keys.

        Raises:
            DamagedError: its edits cannot be read.
        """
        if self.edits_damage is not None:
            raise self.edits_damage
        return digest_of(self.capture.model_dump(mode="json", include=set(keys)))

    @cached_property
    def _digests(self) -> dict[str, str]:
        return {
            key: content_digest(address, self.location, rehash=self.rehash, key=key)
            for key in INPUTS
            if (address := self.file(key)) is not None
        }

    def stamps(self, keys: Collection[str]) -> list[Any]:
        """Return stamps of the files under these keys, which differ once a file changes; no file is read.

        Raises:
            InputError: they cannot be read.
        """
        return [input_stamps(address) for key in sorted(keys) if (address := self.file(key)) is not None]

    def check_unchanged(self, keys: Collection[str]) -> None:
        """Check that the files under these keys still have the digests that were taken; changed ones are read again.

        Raises:
            InputError: one has another digest, or cannot be read.
        """
        for key in sorted(keys):
            address = self.file(key)
            if address is not None and content_digest(address, self.location) != self.digest(key):
                raise InputError(f"{address} changed while it was read", "run again once it is written completely")

    def __reduce__(self) -> Any:
        """Send the fields, and the digests that the keys of stages were made from."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return _restored, (values, self.__dict__.get("_digests"))


def with_edits(contexts: Sequence[CaptureContext]) -> tuple[CaptureContext, ...]:
    """Return the contexts of an object's captures with the edits of the store over their entries in the catalogue.

    A capture whose edits are damaged has the `edits_damage`, and does not keep the others from theirs.

    Raises:
        DamagedError: the list of edits, which all captures need, is not what was written.
    """
    entries = edited_entries(contexts[0].repository, [context.capture for context in contexts])
    return tuple(
        replace(context, edits_damage=entry.damage)
        if entry.edits is None
        else replace(context, capture=entry.capture, edits=entry.edits, catalogue_entry=context.capture)
        for context, entry in zip(contexts, entries, strict=True)
    )


def _restored(values: Mapping[str, Any], digests: dict[str, str] | None) -> CaptureContext:
    context = CaptureContext(**values)
    if digests is not None:
        context.__dict__["_digests"] = digests
    return context


@lru_cache(maxsize=OPEN_REPOSITORIES)
def _repository(store: str, object_id: str) -> ObjectRepository:
    return ObjectRepository.open(Location.parse(store), object_id)
