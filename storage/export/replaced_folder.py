"""Folders that an export writes whole: an earlier export of the same object is replaced, anything else is kept."""

import json
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from glint.storage.errors import StoreError

MARKER = "export.json"
"""File that names the object, version and format of an exported folder."""


@contextmanager
def replaced_folder(out: Path, facts: Mapping[str, str]) -> Iterator[Path]:
    """Yield an empty folder that takes the place of `out` at the end, with `facts` in its MARKER.

    facts: at least `object` and `format`. Nothing is left, and `out` is as it was, where an error ends the block.

    Raises:
        StoreError: `out` holds something else than an earlier export of that object in that format.
        OSError: it cannot be written.
    """
    if out.exists() and not _is_replaceable(out, facts):
        raise StoreError(
            f"{out} is not an export of {facts['object']} as {facts['format']}", "name another folder with --out"
        )
    out.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.resolve().parent))
    try:
        content = temporary / "content"
        content.mkdir()
        yield content
        (content / MARKER).write_text(json.dumps(dict(facts), indent=2) + "\n", encoding="utf-8")
        if out.exists():
            out.rename(temporary / "old")
        content.rename(out)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _is_replaceable(out: Path, facts: Mapping[str, str]) -> bool:
    """Return whether `out` is an empty folder or an earlier export of the same object in the same format."""
    if not out.is_dir():
        return False
    if not any(out.iterdir()):
        return True
    try:
        content = json.loads((out / MARKER).read_text(encoding="utf-8"))
        return all(content[name] == facts[name] for name in ("object", "format"))
    except (OSError, ValueError, KeyError, TypeError):
        return False
