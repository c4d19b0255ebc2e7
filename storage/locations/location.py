"""Locations of stores and inputs: a local path, or an address of an object store (s3://bucket/key, az://container/key).

Credentials, endpoint and region come from the environment or from the usual profile files, never from the address.
"""

import atexit
import os
import re
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import icechunk
import zarr.storage
from obstore.store import AzureStore, LocalStore, ObjectStore, S3Store

from glint.storage.errors import InputError
from glint.storage.locations.credentials import azure_options, s3_options
from glint.storage.locations.foreign_threads import await_foreign_threads

# Whatever opens a location reads it by threads of icechunk or obstore.
atexit.register(await_foreign_threads)

_REMOTE = re.compile(r"(?P<scheme>[A-Za-z][A-Za-z0-9+.-]*)://(?P<rest>.*)", re.DOTALL)
_NEARLY_REMOTE = re.compile(r"(s3|az):(?!//)", re.IGNORECASE)
"""Addresses with a slash too few; a path that begins so is given as ./s3:.."""
_CONTAINER = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{1,62}")
METADATA_FILE = "zarr.json"
"""Name of the file beside the contents of a group or an array that describes it."""
_FORMS = "give a path, s3://bucket/key or az://container/key"


class LocationError(InputError):
    """An address that is malformed or leaves its folder."""


@dataclass(frozen=True, slots=True)
class Location:
    """scheme: `file`, `s3` or `az`; container: bucket or container, empty for `file`; path: absolute, or the key."""

    scheme: str
    container: str
    path: str

    @classmethod
    def parse(cls, address: str | Path, folder: Path | None = None) -> "Location":
        """Return the location of an address; a relative path counts from `folder` (by default the working folder).

        Raises:
            LocationError: empty, of another scheme, without a container, or with credentials.
        """
        text = str(address)
        if not text.strip() or "\0" in text:
            raise LocationError(f"{text!r} is not an address", _FORMS)
        remote = _REMOTE.fullmatch(text)
        if remote is None:
            if _NEARLY_REMOTE.match(text):
                raise LocationError(f"{text!r} is not an address of an object store", _FORMS)
            path = (folder or Path.cwd()) / os.path.expanduser(text)  # noqa: PTH111 - keeps an unknown ~user
            return cls("file", "", os.path.abspath(path))  # noqa: PTH100 - resolves `..`, not links
        scheme, rest = remote["scheme"].lower(), remote["rest"]
        if scheme == "file":
            return cls("file", "", str(Path("/" + rest.lstrip("/"))))
        container, _, key = rest.partition("/")
        if scheme not in ("s3", "az"):
            raise LocationError(f"addresses of {scheme}:// are not supported", _FORMS)
        if "@" in container or ":" in container:
            raise LocationError(
                f"an address of {scheme}:// names only the container and the key",
                "put credentials and the endpoint into the environment or a profile file",
            )
        if not _CONTAINER.fullmatch(container):
            raise LocationError(f"{text!r} names no valid container", _FORMS)
        parts = [part for part in key.split("/") if part]
        if any(part in (".", "..") for part in parts):
            raise LocationError(f"{text!r} has a part '.' or '..' in its key", "write the key without it")
        return cls(scheme, container, "/".join(parts))

    @property
    def uri(self) -> str:
        """The address, for messages and for `parse`."""
        if self.scheme == "file":
            return self.path
        return f"{self.scheme}://{self.container}" + (f"/{self.path}" if self.path else "")

    @property
    def local(self) -> Path | None:
        """The path, None in an object store."""
        return Path(self.path) if self.scheme == "file" else None

    @property
    def is_absent(self) -> bool:
        """Whether this is a local folder that does not exist; an object store has no folders that could be absent."""
        return self.local is not None and not self.local.is_dir()

    @property
    def name(self) -> str:
        """Last part of the path or key."""
        return self.path.rpartition("/")[2]

    @property
    def suffix(self) -> str:
        """Suffix of the name in lower case, with its dot; empty: none."""
        return PurePosixPath(self.name).suffix.lower()

    @property
    def parent(self) -> "Location":
        """The folder or prefix that contains it."""
        return Location(self.scheme, self.container, self.path.rpartition("/")[0] or ("/" * (self.scheme == "file")))

    def child(self, *parts: str) -> "Location":
        """Return a location below this one.

        Raises:
            LocationError: a part is no plain name and could leave this folder.
        """
        for part in parts:
            if part in ("", ".", "..") or any(separator in part for separator in "/\\\0"):
                raise LocationError(f"{part!r} cannot be a name inside {self.uri}", "use a plain name")
        path = "/".join([self.path.rstrip("/"), *parts])
        return Location(self.scheme, self.container, path if self.scheme == "file" else path.lstrip("/"))

    def obstore(self) -> ObjectStore:
        """Return a store of the keys below this location; a local folder is created if absent."""
        if self.scheme == "file":
            return LocalStore(self.path, mkdir=True)
        if self.scheme == "s3":
            return S3Store(self.container, prefix=self.path or None, **s3_options().for_obstore())
        return AzureStore(self.container, prefix=self.path or None, **azure_options().for_obstore())

    def zarr_store(self, read_only: bool = False) -> Any:
        """Return a zarr store of the keys below this location; nothing is created before the first write."""
        if self.scheme == "file":
            return zarr.storage.LocalStore(self.path, read_only=read_only)
        return zarr.storage.ObjectStore(self.obstore(), read_only=read_only)

    def icechunk_storage(self) -> icechunk.Storage:
        """Return icechunk's storage of a repository at this location."""
        if self.scheme == "file":
            return icechunk.local_filesystem_storage(self.path)
        if self.scheme == "s3":
            return icechunk.s3_storage(bucket=self.container, prefix=self.path, **s3_options().for_icechunk())
        options = azure_options()
        return icechunk.azure_storage(
            account=options.account, container=self.container, prefix=self.path, **options.for_icechunk()
        )
