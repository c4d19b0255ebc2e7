"""The reading interface: a store as mappings of objects, versions and captures; arrays are read at the first access.

Whatever was read stays in memory for as long as its object does, and cannot be written to: copy an array to change it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from difflib import get_close_matches
from functools import cached_property
from os import PathLike, fspath
from types import MappingProxyType
from typing import Any

from glint.captures import StoredCapture, frozen_mesh
from glint.storage.errors import NotFoundError, StoreError
from glint.storage.export.camera import CaptureCamera, PixelRegion
from glint.storage.export.mesh_files import Mesh
from glint.storage.export.point_cloud import PointCloud
from glint.storage.export.stored_capture import mesh_of, model_result
from glint.storage.locations.location import Location
from glint.storage.locations.store_folder import check_store
from glint.storage.versions.repository import ObjectRepository, Version, object_ids
from glint.storage.versions.stage_results import WHOLE_OBJECT

__all__ = [
    "CaptureCamera",
    "Mesh",
    "NotFoundError",
    "PixelRegion",
    "PointCloud",
    "Store",
    "StoreError",
    "StoredCapture",
    "StoredObject",
    "StoredVersion",
    "open",
]

_SHOWN_NAMES = 8


def open(address: str | PathLike[str]) -> "Store":
    """Open a store for reading: a folder, s3://bucket/key or az://container/key.

    Credentials, endpoint and region come from the environment or from the usual profile files.

    Raises:
        NotFoundError: there is no store, or the folder holds something else.
        StoreError: the store does not answer.
        LocationError: the address cannot be understood.
    """
    location = Location.parse(fspath(address))
    check_store(location)
    return Store(location)


@dataclass(frozen=True, eq=False, repr=False)
class Store(Mapping[str, "StoredObject"]):
    """A store: its objects by id, in alphabetical order."""

    location: Location
    _objects: dict[str, "StoredObject"] = field(default_factory=dict, init=False)

    def __getitem__(self, object_id: str) -> "StoredObject":
        """Return an object.

        Raises:
            NotFoundError: the store has no object of this id.
        """
        if object_id not in self._objects:
            _check_name(object_id, object_ids(self.location), "object", self.location.uri)
            repository = ObjectRepository.open(self.location, object_id, create=False)
            self._objects[object_id] = StoredObject(object_id, repository)
        return self._objects[object_id]

    def __iter__(self) -> Iterator[str]:
        """Yield the ids of all objects."""
        return iter(object_ids(self.location))

    def __len__(self) -> int:
        """Return the number of objects."""
        return len(object_ids(self.location))

    def __repr__(self) -> str:
        """Return the address and the objects."""
        return f"<Store {self.location.uri}: {_listed(list(self), 'object')}>"


@dataclass(frozen=True, eq=False, repr=False)
class StoredObject(Mapping[str, "StoredVersion"]):
    """An object: its versions by name (v1, v2, ..), oldest first."""

    id: str
    _repository: ObjectRepository
    _versions: dict[str, "StoredVersion"] = field(default_factory=dict, init=False)

    @property
    def versions(self) -> tuple[str, ...]:
        """Names of the versions, oldest first; read from the store each time."""
        return tuple(self._repository.version_names())

    @property
    def latest(self) -> "StoredVersion":
        """The newest version; read from the store each time.

        Raises:
            NotFoundError: the object has no version yet.
        """
        names = self.versions
        if not names:
            raise NotFoundError(f"{self.id} has no version yet", "wait for its run to end, or run it again")
        return self[names[-1]]

    def version(self, name: str) -> "StoredVersion":
        """Return a version by its name; the same as `object[name]`.

        Raises:
            NotFoundError: the object has no such version.
        """
        if name not in self._versions:
            _check_name(name, self.versions, "version", self.id)
            self._versions[name] = StoredVersion(self._repository, self._repository.version(name))
        return self._versions[name]

    def __getitem__(self, name: str) -> "StoredVersion":
        """Return a version by its name.

        Raises:
            NotFoundError: the object has no such version.
        """
        return self.version(name)

    def __iter__(self) -> Iterator[str]:
        """Yield the names of the versions, oldest first."""
        return iter(self.versions)

    def __len__(self) -> int:
        """Return the number of versions."""
        return len(self.versions)

    def __repr__(self) -> str:
        """Return the id and the versions."""
        return f"<StoredObject {self.id!r}: {_listed(self.versions, 'version')}>"


@dataclass(frozen=True, eq=False, repr=False)
class StoredVersion(Mapping[str, StoredCapture]):
    """A version of an object: its captures by id, in alphabetical order. It never changes."""

    _repository: ObjectRepository
    _version: Version
    _captures: dict[str, StoredCapture] = field(default_factory=dict, init=False)

    @property
    def name(self) -> str:
        """The version's name, such as "v2"."""
        return self._version.name

    @property
    def object_id(self) -> str:
        """The object's id."""
        return self._repository.object_id

    @property
    def time(self) -> datetime:
        """The time of publication, with its time zone."""
        return self._version.time

    @property
    def message(self) -> str:
        """The origin of the version in words: a run, or a rollback."""
        return self._version.message

    @property
    def metadata(self) -> Mapping[str, Any]:
        """Provenance of the version: run, catalogue, code version, parameters and digests of inputs by capture."""
        return MappingProxyType(self._version.metadata)

    @cached_property
    def model(self) -> Mesh | None:
        """The mesh merged from all captures with a pose, in the world frame (y up); None where there is none.

        Raises:
            StoreError: it is damaged.
        """
        result = model_result(self._repository, self._version)
        return None if result is None else frozen_mesh(mesh_of(result, "model.ply"))

    @cached_property
    def model_record(self) -> Mapping[str, Any] | None:
        """The content of an export's model.json: unit, pose of each view, volume, area; None without one."""
        result = model_result(self._repository, self._version)
        return None if result is None else MappingProxyType(result.record)

    def __getitem__(self, capture: str) -> StoredCapture:
        """Return a capture.

        Raises:
            NotFoundError: the version has no such capture.
        """
        if capture not in self._captures:
            _check_name(capture, list(self), "capture", f"{self.object_id} {self.name}")
            self._captures[capture] = StoredCapture(capture, self._repository, self._version)
        return self._captures[capture]

    def __iter__(self) -> Iterator[str]:
        """Yield the ids of the captures."""
        return iter(sorted(self._version.captures))

    def __len__(self) -> int:
        """Return the number of captures."""
        return len(self._version.captures)

    def __repr__(self) -> str:
        """Return name, object, time and captures."""
        merged = ", with a model" if WHOLE_OBJECT in self._version.stages else ""
        made = f"{self.time:%Y-%m-%d %H:%M %Z}"
        return f"<StoredVersion {self.name} of {self.object_id!r}, {made}: {_listed(list(self), 'capture')}{merged}>"


def _check_name(name: str, names: Sequence[str], kind: str, owner: str) -> None:
    """Raise a NotFoundError that shows the nearest name, unless `name` is among the names."""
    if name in names:
        return
    nearest = get_close_matches(str(name), names, n=1)
    hint = f"did you mean {nearest[0]!r}? " if nearest else ""
    raise NotFoundError(f"no {kind} {name!r} in {owner}", f"{hint}it has {_listed(names, kind)}")


def _listed(names: Sequence[str], kind: str) -> str:
    """Return how many names there are, and the first of them."""
    shown = ", ".join(names[:_SHOWN_NAMES]) + (", .." if len(names) > _SHOWN_NAMES else "")
    return f"{len(names):,} {kind}{'' if len(names) == 1 else 's'}" + (f": {shown}" if names else "")
