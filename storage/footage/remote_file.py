"""A seekable file of an object store, read in ranges and never fetched whole."""

import obstore

from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.location import Location

BUFFER_BYTES = 1 << 20
"""Size of a range that is fetched."""


class RemoteFile:
    """A binary file of an object store, open for reading; errors of the store are raised as StoreError.

    Raises:
        FileNotFoundError: no such file; StoreError: the store cannot be read.
    """

    def __init__(self, location: Location) -> None:
        self._uri = location.uri
        with store_errors(self._uri, "opening a file"):
            try:
                self._reader = obstore.open_reader(location.parent.obstore(), location.name, buffer_size=BUFFER_BYTES)
            except FileNotFoundError as error:
                missing = error
            else:
                return
        raise missing

    def read(self, size: int = -1) -> bytes:
        """Return the next `size` bytes, all remaining ones if negative; fewer at the end."""
        with store_errors(self._uri, "reading a file"):
            return bytes(self._reader.read(None if size < 0 else size))

    def seek(self, offset: int, whence: int = 0) -> int:
        """Move to an offset from the start (whence 0), the position (1) or the end (2); return the new position."""
        with store_errors(self._uri, "reading a file"):
            return int(self._reader.seek(offset, whence))

    def tell(self) -> int:
        """Return the position."""
        return int(self._reader.tell())
