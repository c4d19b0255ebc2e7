"""Force files and folders onto the disk, so that acknowledged data survive a crash of the machine."""

import os
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

CLOCK_LAG_SECONDS = 0.1
"""Largest lag of modification times behind the system clock."""
N_FLUSHES = 8
"""Files that are flushed at once: a file system writes its journal once for all that wait for it."""


def flush(path: Path) -> None:
    """Force a file's bytes, or a folder's entries, onto the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def flush_new_tree(root: Path, top: Path) -> None:
    """Force all below `root` onto the disk, and the entries of the folders from `top` down to it, its own too."""
    flush_tree(root, 0.0)
    for folder in root.parents:
        flush(folder)
        if folder == top:
            break
    with suppress(PermissionError):  # a folder of another user may be entered, but not opened
        flush(top.parent)


def flush_tree(root: Path, since: float) -> None:
    """Force files and folders below `root` onto the disk that were written at or after `since` (seconds, Unix time)."""
    since -= CLOCK_LAG_SECONDS
    written = [
        path
        for folder, _, names in os.walk(root)
        for path in (*(Path(folder, name) for name in names), Path(folder))
        if path.stat().st_mtime >= since
    ]
    with ThreadPoolExecutor(N_FLUSHES) as pool:
        list(pool.map(flush, written))
