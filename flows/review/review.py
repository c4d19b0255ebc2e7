"""State of the page's server: the store, the catalogue, the rows of its captures, and the runs it has started."""

from functools import lru_cache
from typing import Any

from pydantic import ValidationError

from glint import reading
from glint.flows.review.listing import Listing
from glint.flows.review.object_rows import object_stamp
from glint.flows.review.preparation import Preparation
from glint.flows.review.runs import Runs
from glint.storage.catalogue.loading import Capture, Object
from glint.storage.edits.edits import Edits
from glint.storage.errors import StoreError
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.engine.references import load_catalogue
from glint.tasks.publish import unedited_entry
from glint.tasks.review.stored import VersionReference, has_object, with_rollback

KEPT_VERSIONS = 8
"""Versions that a server keeps open."""


class Review:
    """The state of one server."""

    def __init__(self, store: str, catalogue: str | None, scheduler: str | None = None) -> None:
        self.location = Location.parse(store)
        self.store = self.location.uri
        self.catalogue = None if catalogue is None else Location.parse(catalogue).uri
        self.runs = Runs(self.store, scheduler)
        self.listing = Listing(self.location, self.catalogue, self.runs)
        self.preparation = Preparation()
        self._version = lru_cache(KEPT_VERSIONS)(self._found_version)

    def start(self) -> None:
        """Begin to read the store in the background."""
        self.listing.start()

    def stop(self) -> None:
        """Stop reading the store; runs continue."""
        self.listing.stop()

    def stored(self, object_id: str) -> reading.StoredObject:
        """Return an object of the store, read anew: it may have been removed and filled again.

        Raises:
            NotFoundError: it has none of this id.
        """
        return reading.StoredObject(object_id, self._existing(object_id))

    def version(self, object_id: str, name: str) -> VersionReference:
        """Return a version of an object, kept while the object has not changed: every part of a view asks for it.

        Raises:
            NotFoundError: there is none of this name, or no such object.
        """
        return self._version(object_id, name, object_stamp(self.location, object_id))

    def catalogue_of(self, object_id: str) -> str:
        """Return the address of the catalogue that has an object: the one given, else that of its newest version.

        Raises:
            NotFoundError: neither has it.
        """
        if self.catalogue is not None and self._listed(object_id) is not None:
            return self.catalogue
        address = self.stored(object_id).latest.metadata.get("catalogue")
        if not address:
            raise reading.NotFoundError(f"no catalogue is known for {object_id}", "start glint review with a CATALOGUE")
        return str(address)

    def captures(self, object_id: str) -> list[str]:
        """Return the ids of an object's captures: of the catalogue, else of its newest version.

        Raises:
            NotFoundError: neither has the object.
        """
        listed = self._listed(object_id)
        if listed is not None:
            return [capture.id for capture in listed.captures]
        return sorted(self.stored(object_id).latest)

    def context(self, object_id: str, capture_id: str) -> CaptureContext:
        """Return a capture's context, as a run of it has: from the catalogue, else as its newest version records it.

        Its results are those of the restored version where the last one is a rollback.

        Raises:
            NotFoundError: there is no such capture; StoreError: what is recorded of it cannot be used.
        """
        listed = self._listed(object_id)
        if self.catalogue is not None and listed and any(capture.id == capture_id for capture in listed.captures):
            return with_rollback(CaptureContext.of(load_catalogue(self.catalogue), object_id, capture_id, self.store))
        latest = self.stored(object_id).latest
        recorded = latest.metadata.get("captures", {}).get(capture_id, {})
        entry, parameters = unedited_entry(recorded), recorded.get("parameters", {})
        if entry is None:
            raise reading.NotFoundError(f"no capture {capture_id!r} of {object_id}", "see the catalogue view")
        try:
            capture, checked = Capture.model_validate(entry), Parameters.model_validate(parameters)
        except ValidationError as error:
            message = f"what {object_id} records of {capture_id} cannot be used ({error.errors()[0]['msg']})"
            raise StoreError(message, "start glint review with a CATALOGUE, or run the capture again") from error
        return with_rollback(CaptureContext(self.store, object_id, capture, checked))

    def repository(self, object_id: str) -> ObjectRepository | None:
        """Return the object's results, None where the store has none yet."""
        if not has_object(self.location, object_id):
            return None
        return ObjectRepository.open(self.location, object_id, create=False)

    def edits(self, object_id: str) -> Edits | None:
        """Open the edits of an object, None where the store does not have it yet."""
        repository = self.repository(object_id)
        return None if repository is None else Edits(repository)

    def _listed(self, object_id: str) -> Object | None:
        """Return an object as the catalogue lists it, None where there is no catalogue or it is not in it."""
        objects = () if self.catalogue is None else load_catalogue(self.catalogue).objects
        return next((item for item in objects if item.id == object_id), None)

    def _found_version(self, object_id: str, name: str, _stamp: Any) -> VersionReference:
        repository = self._existing(object_id)
        if name not in repository.version_names():
            raise reading.NotFoundError(f"{object_id} has no version {name!r}", "see the list of its versions")
        return VersionReference(self.store, object_id, name, repository.version(name).snapshot, repository)

    def _existing(self, object_id: str) -> ObjectRepository:
        repository = self.repository(object_id)
        if repository is None:
            raise reading.NotFoundError(f"no object {object_id!r} in {self.store}", "see the catalogue view")
        return repository
