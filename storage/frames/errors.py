"""The error of damaged frames; apart from the cache, so that code that handles it need not import the video decoder."""

from typing import Any

from glint.storage.errors import StoreError

_REBUILD = "run again: the frames are taken from the video or images anew"


class DamagedFrames(StoreError):
    """Cached frames are not those that were written; the cache, `digest`, can be removed and filled again."""

    def __init__(self, message: str, remedy: str = _REBUILD, digest: str = "") -> None:
        super().__init__(message, remedy)
        self.digest = digest

    def __reduce__(self) -> Any:
        """Pickle all fields."""
        return type(self), (self.message, self.remedy, self.digest)
