"""Edits as files: those that a catalogue names, and a YAML file of all else with the keys of a catalogue."""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from glint.storage.catalogue.writing import yaml_text
from glint.storage.catalogue.yaml_file import read_yaml_file
from glint.storage.catalogue.yaml_lines import Kind, LinedDict
from glint.storage.edits.contents import MARKUP_FILE, MASK_FILE, markup_json
from glint.storage.edits.edits import Edits
from glint.storage.edits.models import MAX_MASK_BYTES, Changes, EditsFile, EntryEdits, Revision, mask_png
from glint.storage.errors import InputError, OutputError
from glint.storage.footage.images import decode_mask
from glint.storage.inputs.markup import read_marks
from glint.storage.locations.input_files import locate, read_bytes
from glint.storage.locations.location import Location

EDITS_FILE = "edits.yaml"
_KIND = Kind("file of edits", lambda root: isinstance(root, LinedDict) and "captures" in root, "begin with `captures:`")
_FILE_KEYS = ("spheres", "region", "camera", "pixel_size", "pose", "verdict")


def write_files(edits: Edits, captures: Sequence[str], out: Path) -> list[Path]:
    """Write the newest edits of captures to a folder: edits.yaml, and CAPTURE/mask.png and CAPTURE/markup.json.

    Raises:
        OutputError: the folder holds files already; OSError: it cannot be written; DamagedError: edits are damaged.
    """
    if out.exists() and any(out.iterdir()):
        raise OutputError(f"{out} is not empty", "name a new folder with --out")
    out.mkdir(parents=True, exist_ok=True)
    try:
        return _written(edits, captures, out)
    except BaseException:
        # What is left of a folder would be in the way of the next attempt.
        for path in out.iterdir():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        raise


def _written(edits: Edits, captures: Sequence[str], out: Path) -> list[Path]:
    written, entries = list[Path](), list[dict[str, Any]]()
    for capture in captures:
        current = edits.current(capture)
        entry = {"id": capture} | current.model_dump(mode="json", include=set(_FILE_KEYS), exclude_none=True)
        files = dict[str, bytes]()
        if current.mask is not None:
            files[MASK_FILE], entry["mask"] = mask_png(current.mask), f"{capture}/{MASK_FILE}"
        if current.marks is not None:
            files[MARKUP_FILE], entry["markup"] = markup_json(current.marks), f"{capture}/{MARKUP_FILE}"
        if current.notes:
            entry["notes"] = [note.model_dump(mode="json") for note in current.notes]
        for name, data in files.items():
            written.append(out / capture / name)
            written[-1].parent.mkdir(exist_ok=True)
            written[-1].write_bytes(data)
        entries.append(entry)
    (out / EDITS_FILE).write_bytes(yaml_text({"captures": entries}))
    return [out / EDITS_FILE, *written]


def take_files(
    edits: Edits,
    file: Path,
    author: str,
    only: str | None = None,
    check: Callable[[str, Changes], None] = lambda capture, changes: None,
) -> list[Revision]:
    """Save what a file of edits says, of all its captures or of one; relative paths in it count from its folder.

    Everything is checked before anything is saved, also by `check(capture, changes)`.

    Raises:
        InputError: the file, or one that it names, cannot be used; StoreError: the store cannot be written.
    """
    location = locate(file)
    _, content = read_yaml_file(location, _KIND, EditsFile.model_validate, EditsFile)
    chosen = [entry for entry in content.captures if only in (None, entry.id)]
    if not chosen:
        raise InputError(f"{location.uri} has no capture {only}", "name one that is in it")
    changes = [(entry.id, _changes(entry, location.parent)) for entry in chosen]
    for capture, change in changes:
        check(capture, change)
    saved = (edits.save(capture, change, author, edits.revision) for capture, change in changes)
    return [revision for revision in saved if revision is not None]


def changes_of_files(mask: str | Path | None, markup: str | Path | None) -> Changes:
    """Return the changes of the files that are given: a mask of the frame's size, and marks.

    Raises:
        InputError: one cannot be used.
    """
    values = dict[str, Any]()
    if mask is not None:
        location = locate(mask)
        values["mask"] = decode_mask(read_bytes(location, MAX_MASK_BYTES), location.uri)
        if not values["mask"].any():
            raise InputError(f"the mask {location.uri} is empty", "paint the object white on black")
    if markup is not None:
        values["marks"] = tuple(read_marks(markup))
    return Changes(**values)


def _changes(entry: EntryEdits, folder: Location) -> Changes:
    """Return the changes that an entry says; files count from `folder`."""
    paths = {name: _below(folder, getattr(entry, name)) for name in ("mask", "markup")}
    of_files = changes_of_files(paths["mask"], paths["markup"])
    given = entry.model_fields_set
    values = {name: getattr(entry, name) for name in _FILE_KEYS if name in given}
    values |= {"mask": of_files.mask} if "mask" in given else {}
    values |= {"marks": of_files.marks} if "markup" in given else {}
    return Changes(**values)


def _below(folder: Location, path: str | None) -> Path | str | None:
    return path if path is None or "://" in path or folder.local is None else folder.local / path
