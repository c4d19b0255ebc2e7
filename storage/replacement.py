"""Replace a folder by another one, and keep the earlier until what follows has succeeded."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replaced(folder: Path, new: Path) -> Iterator[None]:
    """Move a folder `new` to the place of another one, which need not exist and comes back if the context fails.

    Meanwhile the earlier one lies beside it, under a hidden name. A process that is killed in between leaves it there.

    Raises:
        OSError: the folder cannot be moved; the earlier one is at its place again.
    """
    earlier = folder.with_name(f".{folder.name}-earlier")
    if folder.exists():
        # What a killed process has left has been replaced since.
        shutil.rmtree(earlier, ignore_errors=True)
        folder.rename(earlier)
    try:
        new.rename(folder)
        yield
    except BaseException:
        if folder.exists():
            folder.rename(new)
        if earlier.exists():
            earlier.rename(folder)
        raise
    shutil.rmtree(earlier, ignore_errors=True)
