"""Folders of exports: files appear whole or not at all, earlier exports of an object are replaced, other files stay."""

import errno
import json
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from glint.storage.errors import OutputError, StoreError, one_line
from glint.storage.replacement import revocable_renames

FULL_BYTES = 1 << 20
"""Free bytes below which a disk counts as full after a write that failed without a cause."""
MARKER = "export.json"
"""File that names the object, version and format of an exported folder."""


@contextmanager
def output_errors(out: Path, object_id: str) -> Iterator[None]:
    """Raise errors of writing an export as OutputError: the store has no part in them.

    Raises:
        OutputError: a file of `out` cannot be written.
    """
    try:
        yield
    except (OSError, RuntimeError) as error:
        # NumPy and OpenEXR report a short write without the system's number of the error.
        cause = getattr(error, "strerror", None) or one_line(error, 200)
        if _is_full(out, error):
            raise OutputError(
                f"the disk of {out} is full: exporting {object_id} failed ({cause})",
                "free space there, or name a folder on another disk with --out",
            ) from error
        if not isinstance(error, OSError):
            raise
        raise OutputError(
            f"exporting {object_id} to {out} failed ({cause})", "name a folder that you may write to with --out"
        ) from error


def _is_full(out: Path, error: Exception) -> bool:
    if isinstance(error, OSError) and error.errno is not None:
        return error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    folder = next(folder for folder in (out, *out.absolute().parents) if folder.exists())
    return shutil.disk_usage(folder).free < FULL_BYTES


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
    place = out.resolve()
    is_disk = place.is_mount()
    with _temporary_folder(place if is_disk else place.parent, place.name) as content:
        yield content
        (content / MARKER).write_text(json.dumps(dict(facts), indent=2) + "\n", encoding="utf-8")
        earlier = [path for path in place.iterdir() if path != content.parent] if is_disk else []
        with revocable_renames() as rename:
            if is_disk:  # which cannot be renamed itself
                _exchange(rename, earlier, content, place)
            else:
                if place.exists():
                    rename(place, content.with_name("old"))
                rename(content, place)


@contextmanager
def temporary_folder_for(out: Path) -> Iterator[Path]:
    """Yield an empty folder `content` on the file system of `out`; it and its parent are removed afterwards.

    It lies in `out` where that is a folder: the one that contains it may be another user's, or on another disk.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    place = out.resolve()
    with _temporary_folder(place if place.is_dir() else place.parent, place.name) as content:
        yield content


@contextmanager
def _temporary_folder(parent: Path, name: str) -> Iterator[Path]:
    parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=f".{name}-", dir=parent))
    try:
        content = temporary / "content"
        content.mkdir()
        yield content
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def merge_into(content: Path, out: Path, object_id: str, report: str) -> None:
    """Move the entries of `content` (see `temporary_folder_for`) to `out`: at once where `out` is new.

    Folders of an earlier export of the object are replaced or removed. They are recognized by their file `report`.
    Where an error ends this, `out` is as it was.

    Raises:
        StoreError: `out` has another folder of the same name.
    """
    if not out.exists():
        content.rename(out)
        return
    for entry in content.iterdir():
        target = out / entry.name
        is_replaceable = target.is_file() if entry.is_file() else _exported_object(target / report) == object_id
        if target.exists() and not is_replaceable:
            raise StoreError(f"{target} is not an export of {object_id}", "name another folder with --out")
    earlier = [
        path
        for path in out.iterdir()
        if (content / path.name).exists() or (path.is_dir() and _exported_object(path / report) == object_id)
    ]
    with revocable_renames() as rename:
        _exchange(rename, earlier, content, out)


def _exchange(rename: Callable[[Path, Path], None], earlier: Iterable[Path], content: Path, out: Path) -> None:
    """Move `earlier` entries of `out` away, and those of `content` there."""
    replaced = content.with_name("old")
    replaced.mkdir()
    for path in earlier:
        rename(path, replaced / path.name)
    for entry in sorted(content.iterdir()):
        rename(entry, out / entry.name)


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
