"""A file of an object store as libraries that read and seek want it: read in ranges, never fetched whole."""

import obstore

from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location

BUFFER = 1 << 20
"""Bytes that are fetched at once."""


class RemoteFile:
    """Reads a file of an object store; gives bytes, and tells failures of the store as StoreError.

    Raises:
        FileNotFoundError: it is not there; StoreError: the store cannot be read.
    """

    def __init__(self, location: Location) -> None:
        self._uri = location.uri
        with store_errors(self._uri, "opening a file"):
            try:
                self._reader = obstore.open_reader(location.parent.obstore(), location.name, buffer_size=BUFFER)
            except FileNotFoundError as error:
                missing = error
            else:
                return
        raise missing

    def read(self, size: int = -1) -> bytes:
        """The next `size` bytes, all that follow if negative; fewer at the end."""
        with store_errors(self._uri, "reading a file"):
            return bytes(self._reader.read(None if size < 0 else size))

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go to a place counted from the start, from here (1) or from the end (2)."""
        with store_errors(self._uri, "reading a file"):
            return int(self._reader.seek(offset, whence))

    def tell(self) -> int:
        """Where it is."""
        return int(self._reader.tell())
