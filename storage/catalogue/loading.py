"""Catalogues: read from YAML with every error at once, written, and made from a folder of captures."""

import io
import os
import posixpath
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import obstore
from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.representer import SafeRepresenter

from glint.storage.catalogue.diagnostics import Problem
from glint.storage.catalogue.from_folder import from_folder
from glint.storage.catalogue.messages import problems_of
from glint.storage.catalogue.models import ADDRESSES, MODEL, Camera, Capture, Catalogue, Object, Pose, Region, Sphere
from glint.storage.catalogue.yaml_lines import MAX_BYTES, LinedDict, LinedList, parse, plain_value
from glint.storage.errors import InputError, StorageError
from glint.storage.locations.error_translation import store_errors
from glint.storage.locations.input_files import Address, locate, read_bytes
from glint.storage.locations.location import Location

__all__ = [
    "Camera",
    "Capture",
    "Catalogue",
    "CatalogueError",
    "Object",
    "Pose",
    "Problem",
    "Region",
    "Sphere",
    "from_folder",
    "load",
    "parameters_for",
    "write",
]


class CatalogueError(StorageError):
    """A catalogue that cannot be used: all its `problems`, in the order of their lines."""

    def __init__(self, problems: tuple[Problem, ...]) -> None:
        self.problems = problems
        super().__init__("\n".join(map(str, problems)), "mend the catalogue and run again")

    def __reduce__(self) -> Any:
        """Survive the journey between processes."""
        return type(self), (self.problems,)


def load(path: Address, parameters_model: type[BaseModel] | None = None) -> Catalogue:
    """Read a catalogue, also one in an object store; relative paths in it count from its folder.

    parameters_model: one field per stage, each a model with a default for every field; what the catalogue's
    `parameters` say is checked against it.

    Raises:
        CatalogueError: with everything that is wrong.
        InputError: no such file, or it is too large; StoreError: the object store cannot be read.
    """
    place, name = locate(path), path.uri if isinstance(path, Location) else str(path)
    root, problems = parse(_text(place, name), name)
    if root is None and problems:
        raise CatalogueError(tuple(problems))
    if not isinstance(root, LinedDict):
        raise CatalogueError(
            (Problem(name, 1, "this is no catalogue", "begin with `schema: 1`, `name` and `objects`"),)
        )
    problems += _crossed(root, name)
    if parameters_model is not None:
        for holder in _holders(root):
            problems += _wrong_parameters(holder, parameters_model, name)
    _resolve(root, place.parent)
    try:
        catalogue = Catalogue.model_validate(root)
    except ValidationError as error:
        problems += problems_of(error, root, Catalogue, name)
    if problems:
        raise CatalogueError(tuple(sorted(set(problems), key=lambda problem: (problem.line, problem.message))))
    return catalogue


def parameters_for(catalogue: Catalogue, object_id: str, capture_id: str) -> dict[str, Any]:
    """Overrides of step parameters of a capture: the catalogue's, overridden by the object's, by the capture's.

    Raises:
        KeyError: no such object or capture.
    """
    each = catalogue.object(object_id)
    merged: dict[str, Any] = {}
    for level in (catalogue.parameters, each.parameters, each.capture(capture_id).parameters):
        merged = _merge(merged, level)
    return merged


def write(catalogue: Catalogue, path: Address) -> None:
    """Write a catalogue, whole or not at all; addresses below its folder become relative.

    Raises:
        OSError, StoreError: it cannot be written.
    """
    place = locate(path)
    data = catalogue.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    folder = place.parent.uri.rstrip("/") + "/"
    for each in data["objects"]:
        for holder in (each, *each["captures"]):
            for key in ADDRESSES:
                if key in holder:
                    holder[key] = holder[key].removeprefix(folder) or holder[key]
    yaml = YAML(typ="safe")
    yaml.Representer = _Representer
    yaml.default_flow_style = None
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.width = 110
    text = io.BytesIO()
    yaml.dump(data, text)
    if place.local is None:
        with store_errors(place.uri, "writing a catalogue"):
            obstore.put(place.parent.obstore(), place.name, text.getvalue(), use_multipart=False)
    else:
        _replace(place.local, text.getvalue())


def _replace(path: Path, data: bytes) -> None:
    with tempfile.NamedTemporaryFile(dir=path.parent, prefix=".", suffix=".yaml", delete=False) as file:
        try:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
            os.chmod(file.name, 0o644)  # noqa: PTH101
            Path(file.name).replace(path)
        except BaseException:
            Path(file.name).unlink(missing_ok=True)
            raise


class _Representer(SafeRepresenter):
    """Quotes every text that would be read as another value."""

    def represent_str(self, data: str) -> Any:
        style = None if plain_value(data) == data else '"'
        return self.represent_scalar("tag:yaml.org,2002:str", data, style)


_Representer.add_representer(str, _Representer.represent_str)


def _text(place: Location, name: str) -> str:
    try:
        return _bytes(place, name).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise CatalogueError((Problem(name, line, "this is not UTF-8 text", "save the file as UTF-8"),)) from error


def _bytes(place: Location, name: str) -> bytes:
    if place.local is None:
        return read_bytes(place, MAX_BYTES)
    try:
        if place.local.exists() and not place.local.is_file():
            raise InputError(f"the catalogue {name} is not a file", "name the YAML file")
        if place.local.stat().st_size > MAX_BYTES:
            raise InputError(
                f"{name} has {place.local.stat().st_size:,} bytes", f"a catalogue has at most {MAX_BYTES:,}; split it"
            )
        return place.local.read_bytes()
    except OSError as error:
        raise InputError(f"the catalogue {name} cannot be read ({error.strerror})", "check the path") from error


def _holders(root: LinedDict) -> Iterator[LinedDict]:
    """The catalogue, its objects and their captures, as far as they are mappings."""
    yield root
    for each in _mappings(root.get("objects")):
        yield each
        yield from _mappings(each.get("captures"))


def _mappings(value: Any) -> list[LinedDict]:
    return [item for item in value if isinstance(item, LinedDict)] if isinstance(value, LinedList) else []


def _crossed(root: LinedDict, file: str) -> list[Problem]:
    """Rules between keys, told beside whatever else is wrong."""
    problems: list[Problem] = []
    objects = _mappings(root.get("objects"))
    for what, group in (("object", objects), *(("capture", _mappings(each.get("captures"))) for each in objects)):
        seen: dict[str, int] = {}
        for item in group:
            name = item.get("id")
            if isinstance(name, str) and name in seen:
                message = f"{what} id {name!r} is taken by line {seen[name]}"
                problems.append(Problem(file, item.lines["id"], message, "choose another id"))
            elif isinstance(name, str):
                seen[name] = item.lines["id"]
            if what == "capture" and name == MODEL:
                message = f"the id {MODEL!r} is that of the object's merged model"
                problems.append(Problem(file, item.lines["id"], message, "choose another id"))
            if what == "capture" and item.get("spheres") and item.get("lights"):
                message = "a capture has either spheres or lights, not both"
                problems.append(Problem(file, item.lines["lights"], message, "remove one of the two"))
    return problems


def _wrong_parameters(holder: LinedDict, model: type[BaseModel], file: str) -> list[Problem]:
    parameters = holder.get("parameters")
    if not isinstance(parameters, LinedDict) or not parameters:
        return []
    try:
        model.model_validate(parameters)
    except ValidationError as error:
        return problems_of(error, parameters, model, file)
    return []


def _resolve(root: LinedDict, folder: Location) -> None:
    """Make relative paths absolute."""
    for holder in _holders(root):
        for key in ADDRESSES:
            value = holder.get(key)
            if isinstance(value, str) and value and "://" not in value:
                holder[key] = _below(folder, value)


def _below(folder: Location, path: str) -> str:
    if folder.local is not None or path.startswith("/"):
        return os.path.normpath(Path(folder.path) / path)
    return f"{folder.scheme}://{folder.container}/{posixpath.normpath(posixpath.join(folder.path, path))}"


def _merge(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(below)
    for key, value in above.items():
        old = merged.get(key)
        both = isinstance(value, Mapping) and isinstance(old, Mapping)
        merged[key] = _merge(old, value) if both else value  # type: ignore[arg-type]
    return merged
