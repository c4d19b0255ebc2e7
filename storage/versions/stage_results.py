"""One stage's result as a versioned store holds it: key and record, arrays, files (meshes, pictures).

It lies in a group of its own, with key and record as the attributes. Files are uint8 arrays (size,) in the subgroup
`files`, named like the file. They are part of the commit: a version holds whole results.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import zarr

from glint.storage.errors import StoreError, damaged
from glint.storage.versions.stages.checksums import VerifiedGroup

WHOLE_OBJECT = "_object"
"""Takes the place of a capture for results of the whole object, such as its model; no capture can have this name."""

Keys = dict[str, dict[str, str]]
"""Stage keys by capture and stage."""

EarlierKeys = dict[str, list[dict[str, str]]]
"""By capture the stage keys of several results."""


@dataclass(frozen=True, slots=True)
class StoredFile:
    """Content and media type of a file to be stored."""

    data: bytes
    media_type: str


@dataclass(frozen=True, slots=True)
class FileInfo:
    """Size in bytes, SHA-256 (hexadecimal) and media type of a stored file."""

    size: int
    sha256: str
    media_type: str


@dataclass(frozen=True, slots=True, kw_only=True)
class StageResult:
    """A stored result: `arrays` are read when indexed, or whole by `read`, files by `read_file`; `record` is JSON.

    version: its name, `work` for the newest results. group: all that was stored of it, each value verified as it is
    read.
    """

    object_id: str
    capture: str
    stage: str
    version: str = "work"
    key: str
    record: dict[str, Any]
    files: dict[str, FileInfo]
    group: VerifiedGroup = field(repr=False)

    @property
    def arrays(self) -> Mapping[str, zarr.Array]:
        """The arrays by name, without those that hold the files."""
        return self.group.arrays

    @property
    def name(self) -> str:
        """Object, capture, stage and version, for messages."""
        return owner_name(self.object_id, self.capture, self.stage, self.version)

    def read(self, name: str) -> np.ndarray:
        """Return array `name`, read into memory.

        Raises:
            StoreError: the stage has no such array; DamagedError: it is damaged.
        """
        if name not in self.arrays:
            raise _absent_error(self.name, "array", name, self.arrays)
        return np.asarray(self.arrays[name][...])

    def read_file(self, name: str) -> bytes:
        """Return the content of file `name`, verified by its size and SHA-256.

        Raises:
            StoreError: the stage has no such file; DamagedError: it is damaged.
        """
        if name not in self.files:
            raise _absent_error(self.name, "file", name, self.files)
        if name not in self.group.file_arrays:
            raise damaged(f"file {name!r} of {self.name}", "nothing was stored of it", self.object_id)
        info, data = self.files[name], np.asarray(self.group.file_arrays[name][...]).tobytes()
        if len(data) != info.size or hashlib.sha256(data).hexdigest() != info.sha256:
            raise damaged(f"file {name!r} of {self.name}", "it is not what was written", self.object_id)
        return data


def _absent_error(owner: str, kind: str, name: str, present: Mapping[str, Any]) -> StoreError:
    return StoreError(
        f"{owner} has no {kind} {name!r}, only {', '.join(sorted(present)) or 'none'}",
        "run the capture again with this version of Glint",
    )


def owner_name(object_id: str, capture: str, stage: str, version: str) -> str:
    """Return object, capture, stage and version, as messages name a result."""
    return f"{object_id}/{capture}/{stage}" + (f" in {version}" if version != "work" else "")
