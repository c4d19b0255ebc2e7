"""Footage that is another footage's, with something done to the frames that pass."""

from collections.abc import Iterator
from typing import Self

import numpy as np

from glint.storage.footage.source import Footage


class FootageWrapper:
    """The frames of an open footage, which whoever opened it closes; subclasses override `frames`."""

    def __init__(self, footage: Footage) -> None:
        """Wrap an open footage."""
        self._footage = footage
        self.uri, self.count, self.codec = footage.uri, footage.count, footage.codec
        self.bits, self.height, self.width, self.names = footage.bits, footage.height, footage.width, footage.names

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Do nothing."""

    @property
    def warnings(self) -> list[str]:
        """Damage met in the last complete pass over the frames."""
        return self._footage.warnings

    def frames(self, start: int = 0, step: int = 1) -> Iterator[np.ndarray]:
        """Yield the luma (H, W) of frames start, start + step, .."""
        return self._footage.frames(start, step)

    def spread(self, count: int) -> list[np.ndarray]:
        """Return about `count` frames spread over the footage, as they were recorded."""
        return self._footage.spread(count)
