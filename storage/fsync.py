"""What is acknowledged must survive the machine's death: bytes and names on the disk itself."""

import os
from pathlib import Path

LAG_SECONDS = 0.1
"""How far a file system's own clock may be behind."""


def flush(path: Path) -> None:
    """Force a file's bytes, or a folder's names, onto the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def flush_tree(root: Path, since: float) -> None:
    """Force onto the disk what was written below `root` at or after `since` (seconds of the epoch)."""
    since -= LAG_SECONDS
    for folder, _, names in os.walk(root):
        for name in names:
            path = Path(folder, name)
            if path.stat().st_mtime >= since:
                flush(path)
        if Path(folder).stat().st_mtime >= since:
            flush(Path(folder))
