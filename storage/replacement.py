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

    Meanwhile the earlier one lies beside it, under a hidden name. A process that is killed in between leaves it there:
    see `restore_earlier`.

    Raises:
        OSError: the folder cannot be moved; the earlier one is at its place again.
    """
    restore_earlier(folder)
    earlier, obsolete = _hidden(folder, "earlier"), _hidden(folder, "obsolete")
    shutil.rmtree(obsolete, ignore_errors=True)
    with revocable_renames() as rename:
        if folder.exists():
            rename(folder, earlier)
        rename(new, folder)
        yield
        # Its name shows whether the replacement was complete.
        if earlier.exists():
            rename(earlier, obsolete)
    shutil.rmtree(obsolete, ignore_errors=True)


def restore_earlier(folder: Path) -> bool:
    """Return whether a process was killed while it replaced a folder; the earlier one is at its place again.

    Raises:
        OSError: the folder cannot be moved.
    """
    earlier = _hidden(folder, "earlier")
    if not earlier.exists():
        return False
    obsolete = _hidden(folder, "obsolete")
    if folder.exists():
        shutil.rmtree(obsolete, ignore_errors=True)
        folder.rename(obsolete)
    earlier.rename(folder)
    shutil.rmtree(obsolete, ignore_errors=True)
    return True


def _hidden(folder: Path, state: str) -> Path:
    return folder.with_name(f".{folder.name}-{state}")
