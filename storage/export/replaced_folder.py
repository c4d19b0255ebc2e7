"""Folders of exports: files appear whole or not at all, earlier exports of an object are replaced, other files stay."""

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
    with temporary_folder_beside(out) as content:
        yield content
        (content / MARKER).write_text(json.dumps(dict(facts), indent=2) + "\n", encoding="utf-8")
        if out.exists():
            out.rename(content.with_name("old"))
        content.rename(out)


@contextmanager
def temporary_folder_beside(out: Path) -> Iterator[Path]:
    """Yield an empty folder `content` on the file system of `out`; it and its parent are removed afterwards."""
    out.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.resolve().parent))
    try:
        content = temporary / "content"
        content.mkdir()
        yield content
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def merge_into(content: Path, out: Path, object_id: str, report: str) -> None:
    """Move the entries of `content` (see `temporary_folder_beside`) to `out`: at once where `out` is new.

    Folders of an earlier export of the object are replaced or removed. They are recognized by their file `report`.

    Raises:
        StoreError: `out` has another folder of the same name.
    """
    if not out.exists():
        content.rename(out)
        return
    for entry in content.iterdir():
        target = out / entry.name
        if entry.is_dir() and target.exists() and _exported_object(target / report) != object_id:
            raise StoreError(f"{target} is not an export of {object_id}", "name another folder with --out")
    replaced = content.with_name("old")
    replaced.mkdir()
    for folder in [path for path in out.iterdir() if path.is_dir()]:
        if not (content / folder.name).exists() and _exported_object(folder / report) == object_id:
            folder.rename(replaced / folder.name)
    for entry in sorted(content.iterdir()):
        target = out / entry.name
        if target.is_dir():
            target.rename(replaced / entry.name)
        entry.replace(target)


def _exported_object(report: Path) -> str | None:
    """Return the id of the object that an export's report names; None if it is no report."""
    try:
        return str(json.loads(report.read_text(encoding="utf-8"))["object"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


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
