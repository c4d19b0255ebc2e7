"""Read catalogues from YAML, with all errors at once."""

import os
import posixpath
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from glint.storage.catalogue.diagnostics import Diagnostic
from glint.storage.catalogue.from_folder import from_folder
from glint.storage.catalogue.messages import diagnostics_of
from glint.storage.catalogue.models import (
    ADDRESS_KEYS,
    RESERVED_IDS,
    Camera,
    Capture,
    Catalogue,
    Object,
    Pose,
    Region,
    Sphere,
)
from glint.storage.catalogue.writing import write
from glint.storage.catalogue.yaml_lines import MAX_BYTES, Kind, LinedDict, LinedList, parse
from glint.storage.errors import GlintError, InputError, printable
from glint.storage.locations.input_files import Address, check_plain_file, locate, read_bytes
from glint.storage.locations.location import Location
from glint.storage.locations.time_limit import within_time

__all__ = [
    "Camera",
    "Capture",
    "Catalogue",
    "CatalogueError",
    "Diagnostic",
    "Object",
    "Pose",
    "Region",
    "Sphere",
    "from_folder",
    "load",
    "parameters_for",
    "write",
]


MAX_CAPTURES = 100_000
"""Captures of one catalogue: so many are read within a minute."""
_FRAMES_KEY = re.compile(r"\bframes['\"]?\s*:")
"""What every capture has, found before the file is parsed: that takes long where there are too many."""
CATALOGUE_KIND = Kind(
    "catalogue",
    lambda root: isinstance(root, LinedDict) and not {"schema", "objects"}.isdisjoint(root),
    "begin with `schema: 1`, `name` and `objects`",
)


class CatalogueError(GlintError):
    """An invalid catalogue, with all its errors in the order of their lines."""

    def __init__(self, diagnostics: tuple[Diagnostic, ...]) -> None:
        self.diagnostics = diagnostics
        super().__init__("", "fix the catalogue and run again")
        self.message = "\n".join(printable(str(diagnostic)) for diagnostic in diagnostics)
        self.args = (f"{self.message}: {self.remedy}",)

    def __reduce__(self) -> Any:
        """Support pickling, since the constructor's arguments differ from the exception's."""
        return type(self), (self.diagnostics,)


def load(path: Address, parameters_model: type[BaseModel] | None = None) -> Catalogue:
    """Read a catalogue, also one in an object store; relative paths in it count from its folder.

    parameters_model: one field per stage, each a model with a default for every field; the catalogue's `parameters`
    are validated against it.

    Raises:
        CatalogueError: invalid; it lists all errors.
        InputError: no such file, or it is too large; StoreError: the object store cannot be read.
    """
    location, name = locate(path), path.uri if isinstance(path, Location) else str(path)
    text = _text(location, name)
    captures = len(_FRAMES_KEY.findall(text))
    if captures > MAX_CAPTURES:
        message = f"this lists about {captures:,} captures"
        raise CatalogueError((Diagnostic(name, 1, message, f"at most {MAX_CAPTURES:,} are read: split the catalogue"),))
    root, diagnostics = parse(text, name, CATALOGUE_KIND)
    if root is None:
        raise CatalogueError(tuple(diagnostics))
    diagnostics += _check_keys_together(root, name)
    if parameters_model is not None:
        for entry in _entries(root):
            diagnostics += _check_parameters(entry, parameters_model, name)
    _resolve_addresses(root, location.parent)
    try:
        catalogue = Catalogue.model_validate(root)
    except ValidationError as error:
        diagnostics += diagnostics_of(error, root, Catalogue, name)
    if diagnostics:
        unique = set(diagnostics)
        raise CatalogueError(tuple(sorted(unique, key=lambda diagnostic: (diagnostic.line, diagnostic.message))))
    return catalogue


def parameters_for(
    catalogue: Catalogue,
    object_id: str,
    capture_id: str,
    with_current_names: Callable[[Mapping[str, Any]], Mapping[str, Any]] = dict,
) -> dict[str, Any]:
    """Return a capture's stage parameters: its own override the object's, these the catalogue's.

    with_current_names: applied to those of each level before they are merged.

    Raises:
        KeyError: no such object or capture.
    """
    item = catalogue.object(object_id)
    merged: dict[str, Any] = {}
    for level in (catalogue.parameters, item.parameters, item.capture(capture_id).parameters):
        merged = _merge(merged, with_current_names(level))
    return merged


def _text(location: Location, name: str) -> str:
    try:
        return _bytes(location, name).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise CatalogueError((Diagnostic(name, line, "this is not UTF-8 text", "save the file as UTF-8"),)) from error


def _bytes(location: Location, name: str) -> bytes:
    path = location.local
    if path is None:
        return read_bytes(location, MAX_BYTES)
    try:
        return within_time(lambda step: _local_bytes(path, name), name)
    except OSError as error:
        raise InputError(f"the catalogue {name} cannot be read ({error.strerror})", "check the path") from error


def _local_bytes(path: Path, name: str) -> bytes:
    if path.exists() and not path.is_file():
        raise InputError(f"the catalogue {name} is not a file", "name the YAML file")
    check_plain_file(path)
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise InputError(f"{name} has {size:,} bytes", f"a catalogue has at most {MAX_BYTES:,}; split it")
    return path.read_bytes()


def _entries(root: LinedDict) -> Iterator[LinedDict]:
    """Yield the catalogue, its objects and their captures, those that are mappings."""
    yield root
    for item in _mappings(root.get("objects")):
        yield item
        yield from _mappings(item.get("captures"))


def _mappings(value: Any) -> list[LinedDict]:
    return [item for item in value if isinstance(item, LinedDict)] if isinstance(value, LinedList) else []


def _check_keys_together(root: LinedDict, file: str) -> list[Diagnostic]:
    """Check the rules between keys; pydantic would report them only once all else is valid."""
    objects = _mappings(root.get("objects"))
    diagnostics = _check_distinct("object", objects, file)
    for item in objects:
        captures = _mappings(item.get("captures"))
        diagnostics += _check_distinct("capture", captures, file)
        for capture in captures:
            capture_id = capture.get("id")
            if isinstance(capture_id, str) and capture_id in RESERVED_IDS:
                message = f"the id {capture_id!r} is that of {RESERVED_IDS[capture_id]}"
                diagnostics.append(Diagnostic(file, capture.lines["id"], message, "choose another id"))
            if capture.get("spheres") and capture.get("lights"):
                message = "a capture has either spheres or lights, not both"
                diagnostics.append(Diagnostic(file, capture.lines["lights"], message, "remove one of the two"))
    return diagnostics


def _check_distinct(kind: str, entries: list[LinedDict], file: str) -> list[Diagnostic]:
    """Report ids that an earlier entry has."""
    diagnostics: list[Diagnostic] = []
    first_lines: dict[str, int] = {}
    for entry in entries:
        name = entry.get("id")
        if isinstance(name, str) and name in first_lines:
            message = f"{kind} id {name!r} is taken by line {first_lines[name]}"
            diagnostics.append(Diagnostic(file, entry.lines["id"], message, "choose another id"))
        elif isinstance(name, str):
            first_lines[name] = entry.lines["id"]
    return diagnostics


def _check_parameters(entry: LinedDict, model: type[BaseModel], file: str) -> list[Diagnostic]:
    parameters = entry.get("parameters")
    if not isinstance(parameters, LinedDict) or not parameters:
        return []
    try:
        model.model_validate(parameters)
    except ValidationError as error:
        return diagnostics_of(error, parameters, model, file, ("parameters",))
    return []


def _resolve_addresses(root: LinedDict, folder: Location) -> None:
    """Make relative paths absolute."""
    for entry in _entries(root):
        for key in ADDRESS_KEYS:
            value = entry.get(key)
            if isinstance(value, str) and value and "://" not in value:
                entry[key] = _below(folder, value)


def _below(folder: Location, path: str) -> str:
    if folder.local is not None or path.startswith("/"):
        return os.path.normpath(Path(folder.path) / path)
    return f"{folder.scheme}://{folder.container}/{posixpath.normpath(posixpath.join(folder.path, path))}"


def _merge(base: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, value in overrides.items():
        old = merged.get(key)
        merged[key] = _merge(old, value) if isinstance(value, Mapping) and isinstance(old, Mapping) else value
    return merged
