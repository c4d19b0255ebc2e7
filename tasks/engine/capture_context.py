"""What a step works on: one capture of one object in one store, with its parameters; small enough to send anywhere."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from glint.storage.catalogue.loading import Capture, Catalogue, parameters_for
from glint.storage.inputs.digests import content_digest, digest_of
from glint.storage.inputs.masks_and_truth import camera_matrix
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import StageResult
from glint.tasks.engine.parameters import Parameters

INPUTS = ("frames", "lights", "mask", "markup")
"""Keys of a capture that name files."""


OPEN_REPOSITORIES = 8
"""Objects whose repository a process keeps open."""


@dataclass(frozen=True)
class Workspace:
    """A capture's place of work. `store` is an address; `run` names the run; `rehash`: trust no remembered digest."""

    store: str
    object_id: str
    capture: Capture
    parameters: Parameters
    run: str = ""
    rehash: bool = False

    @classmethod
    def of(
        cls, catalogue: Catalogue, object_id: str, capture_id: str, store: str, run: str = "", rehash: bool = False
    ) -> "Workspace":
        """The workspace of a catalogue's capture, its parameters merged."""
        capture = catalogue.object(object_id).capture(capture_id)
        parameters = Parameters.model_validate(parameters_for(catalogue, object_id, capture_id))
        return cls(store, object_id, capture, parameters, run, rehash)

    @property
    def name(self) -> str:
        """OBJECT/CAPTURE, as the command line says it."""
        return f"{self.object_id}/{self.capture.id}"

    @property
    def location(self) -> Location:
        """The store's place."""
        return Location.parse(self.store)

    @property
    def repository(self) -> ObjectRepository:
        """The object's results; kept open in this process for the next stage."""
        return _repository(self.store, self.object_id)

    @property
    def camera_matrix(self) -> np.ndarray | None:
        """The perspective camera's matrix (3, 3) in pixels of the full frame; None: orthographic."""
        return camera_matrix(self.capture.camera)

    def digest(self, key: str) -> str | None:
        """Content digest of one of the capture's inputs (`frames`, `mask`, ..), None where it has none."""
        address = getattr(self.capture, key)
        return None if address is None else self._digests[key]

    def load(self, stage: str) -> StageResult:
        """What an earlier stage saved."""
        return self.repository.load(self.capture.id, stage)

    @cached_property
    def _digests(self) -> dict[str, str]:
        named = {key: getattr(self.capture, key) for key in INPUTS}
        return {
            key: content_digest(address, self.location, rehash=self.rehash)
            for key, address in named.items()
            if address is not None
        }

    def __reduce__(self) -> Any:
        """Send the facts alone; digests are looked up again where they are needed."""
        return type(self), (self.store, self.object_id, self.capture, self.parameters, self.run, self.rehash)


@lru_cache(maxsize=OPEN_REPOSITORIES)
def _repository(store: str, object_id: str) -> ObjectRepository:
    return ObjectRepository.open(Location.parse(store), object_id)


def facts_of(capture: Capture, names: tuple[str, ...]) -> str:
    """Digest of what the catalogue says of a capture under these keys."""
    said = capture.model_dump(mode="json", include=set(names))
    return digest_of(said)
