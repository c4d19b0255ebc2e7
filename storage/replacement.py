"""Rename files and folders so that what an error interrupts is as it was; replace a folder by another one."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def revocable_renames() -> Iterator[Callable[[Path, Path], None]]:
    """Yield a function that renames; where anything ends the block, all that it renamed get their names back."""
    renames = list[tuple[Path, Path]]()

    def rename(source: Path, target: Path) -> None:
        # Noted first: an interrupt may come between the two.
        renames.append((source, target))
        source.rename(target)

    try:
        yield rename
    except BaseException:
        for source, target in reversed(renames):
            # The last one may not have happened.
            if target.exists(follow_symlinks=False) and not source.exists(follow_symlinks=False):
                target.rename(source)
        raise


@contextmanager
def replaced(folder: Path, new: Path) -> Iterator[None]:
    """Move a folder `new` to the place of another one, which need not exist and comes back if the context fails.

    Meanwhile the earlier one lies beside it, under a hidden name. A process that is killed in between leaves it there.

    Raises:
        OSError: the folder cannot be moved; the earlier one is at its place again.
    """
    earlier = folder.with_name(f".{folder.name}-earlier")
    with revocable_renames() as rename:
        if folder.exists():
            # What a killed process has left has been replaced since.
            shutil.rmtree(earlier, ignore_errors=True)
            rename(folder, earlier)
        rename(new, folder)
        yield
    shutil.rmtree(earlier, ignore_errors=True)
