"""Turn pydantic's validation errors into diagnostics: line, value, cause, and for an unknown key the nearest known."""

import difflib
import re
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from glint.storage.catalogue.diagnostics import Diagnostic, truncate_repr
from glint.storage.catalogue.yaml_lines import line_of

_REMEDIES = {
    "string_type": "write text, in quotes if it looks like a number",
    "float_type": "write a number such as 2.5, with a point, without quotes and without a unit",
    "float_parsing": "write a number",
    "int_parsing": "write a whole number",
    "bool_parsing": "write true or false",
    "int_type": "write a whole number without quotes",
    "int_from_float": "write a whole number",
    "bool_type": "write true or false",
    "tuple_type": "write a list: [..]",
    "list_type": "write a list: [..]",
    "model_type": "write keys and values",
    "dict_type": "write keys and values",
    "finite_number": "write a finite number",
    "string_too_short": "write something",
    "string_too_long": "shorten it",
    "too_long": "list fewer",
    "string_pattern_mismatch": "remove the character",
    "int_parsing_size": "check the number",
    "greater_than": "check the number and its unit",
    "less_than": "check the number and its unit",
    "camera": "give the matrix in pixels; transpose it if its last column is 0, 0, 1",
    "pose": "give exactly one of the two",
    "last_row": "transpose the matrix if its last column is 0, 0, 0, 1",
    "not_orthonormal": "give a rotation there, without a scale, and lengths in the last column only",
    "mirrored": "negate one of these columns: x points to the right, y up, z backwards, away from what the camera sees",
    "greater_than_equal": "check the number and its unit",
    "less_than_equal": "check the number and its unit",
    "same_sphere": "remove one",
    "literal_error": "write one of them",
    "found_or_height": "write `found`, or the plane's height y in the model's unit",
    "schema": "write `schema: 1`",
}
"""Remedies by pydantic's name of the error."""
_DEFAULT_REMEDY = "fix the value"
_MATRIX_REMEDIES = {
    "matrix": "write three rows of three numbers: [[fx, skew, cx], [0, fy, cy], [0, 0, 1]]",
    "camera_to_world": "write four rows of four numbers, the last one [0, 0, 0, 1]",
}
"""Remedies for too many or too few rows or numbers, by key."""
_DISTORTION = re.compile("dist", re.IGNORECASE)
_DISTORTION_REMEDY = "lens distortion is not modelled: undistort the frames, and give their new matrix"
_FAULTS = {
    "model_type": "this is no set of keys with values",
    "dict_type": "this is no set of keys with values",
    "tuple_type": "this is no list",
    "list_type": "this is no list",
    "int_parsing_size": "this is no number that can be meant",
}
"""Faults by pydantic's name of the error, where its own words are about Python."""
_OWN = ("camera", "pose", "last_row", "not_orthonormal", "mirrored", "same_sphere")
"""Errors whose words are Glint's own, and name the value where that helps."""
_REPORTED_BY_LOADER = ("duplicate_id", "spheres_and_lights")
"""Errors that the catalogue's loader reports with the lines of both keys."""


def diagnostics_of(
    error: ValidationError, root: Any, model: type[BaseModel], file: str, prefix: tuple[str, ...] = ()
) -> list[Diagnostic]:
    """Return one diagnostic per error, without those that repeat another.

    prefix: keys of the file that lead to the root, named in messages.
    """
    details = error.errors(include_url=False)
    return [_diagnostic(detail, root, model, file, prefix) for detail in details if not _is_redundant(detail)]


def _is_redundant(detail: ErrorDetails) -> bool:
    """Return whether the error is reported in another place: by the loader, or as errors of a list's items.

    Pydantic drops invalid items and then also reports that the list is too short.
    """
    if detail["type"] in _REPORTED_BY_LOADER:
        return True
    context = detail.get("ctx", {})
    return detail["type"] == "too_short" and len(detail["input"]) >= context.get("min_length", 1)


def _diagnostic(
    detail: ErrorDetails, root: Any, model: type[BaseModel], file: str, prefix: tuple[str, ...]
) -> Diagnostic:
    location = tuple(detail["loc"])
    line, path, kind = line_of(root, location), _format_path(prefix + location), detail["type"]
    if kind == "extra_forbidden":
        known = _known_keys(model, location[:-1])
        near = difflib.get_close_matches(str(location[-1]), known, 1, 0.5)
        keys = f"known keys are {', '.join(known)}" if len(known) > 1 else f"the only key is {''.join(known)}"
        keys = keys if known else "no keys are known here: remove it"
        remedy = f"did you mean {near[0]!r}?" if near else keys
        if location[-2:-1] == ("camera",) and _DISTORTION.search(str(location[-1])):
            remedy = _DISTORTION_REMEDY
        message = f"unknown key {truncate_repr(location[-1])} in {_format_path(prefix + location[:-1])}"
        return Diagnostic(file, line, message, remedy)
    if kind == "missing":
        return Diagnostic(file, line, f"{path} is missing", _matrix_remedy(location) or "add it")
    if kind == "string_pattern_mismatch" and location[-1] == "id":
        remedy = "1 to 64 of a-z, 0-9, '.', '_' and '-', the first a letter or digit"
        return Diagnostic(file, line, f"{path} {truncate_repr(detail['input'])} is not a valid id", remedy)
    if kind == "too_short" and not detail["input"]:
        return Diagnostic(file, line, f"{path} is empty", "list at least one")
    remedy = _REMEDIES.get(kind, _DEFAULT_REMEDY)
    if kind == "model_type" and (known := _known_keys(model, location)):
        remedy = f"{remedy}: {', '.join(known)}"
    if kind == "string_type" and location[-1] == "frames":
        remedy = "write one path; a folder, or shots/*.png, names several files"
    if kind == "too_long":
        remedy = _matrix_remedy(location) or remedy
    if kind == "schema":
        return Diagnostic(file, line, detail["msg"], remedy)
    if kind == "same_sphere":
        return Diagnostic(file, line, f"{path}: {detail['msg']}", remedy)
    return Diagnostic(file, line, f"{path} is {fault_of(detail)}", remedy)


def _matrix_remedy(location: tuple[int | str, ...]) -> str | None:
    """Return how to write the matrix that a path leads to or into, None where it leads to something else."""
    keys = [step for step in location if isinstance(step, str)]
    return _MATRIX_REMEDIES.get(keys[-1]) if keys else None


def fault_of(detail: ErrorDetails) -> str:
    """Return a value and what is wrong with it."""
    fault = _FAULTS.get(detail["type"]) or f"{detail['msg'][:1].lower()}{detail['msg'][1:]}"
    if detail["type"] == "string_pattern_mismatch":
        is_null = "\0" in detail["input"]
        fault = "no path holds a null character" if is_null else f"this is not of the form {detail['ctx']['pattern']}"
    if detail["type"] == "too_long" and not isinstance(detail["input"], str):
        fault = f"at most {detail['ctx']['max_length']} items are allowed, not {len(detail['input'])}"
    return f"{truncate_repr(detail['input'])}: {fault}"


def own_words(detail: ErrorDetails) -> tuple[str, str] | None:
    """Return what is wrong and what to do where Glint's own checks say it; None for an error in pydantic's words."""
    if detail["type"] in _OWN:
        return detail["msg"], _REMEDIES[detail["type"]]
    if detail["type"] != "value_error":
        return None
    message, _, remedy = str(detail["ctx"]["error"]).rpartition(": ")
    return (message, remedy) if message else (remedy, _DEFAULT_REMEDY)


def _format_path(location: tuple[int | str, ...]) -> str:
    """Format a path as objects[3].captures[0].region.x, counted from 0; the root is the file."""
    text = ""
    for step in location:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else str(step)
    return text or "the file"


def _known_keys(model: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """Return the keys that the model allows at a path."""
    current: Any = model
    for step in location:
        if isinstance(step, str) and isinstance(current, type) and issubclass(current, BaseModel):
            fields: dict[str, FieldInfo] = current.model_fields
            field = next((field for name, field in fields.items() if step in (name, field.alias)), None)
            if field is None:
                return []
            current = _inner_model(field.annotation)
    if not (isinstance(current, type) and issubclass(current, BaseModel)):
        return []
    return [field.alias or name for name, field in current.model_fields.items()]


def _inner_model(annotation: Any) -> Any:
    """Return the model inside an optional, a tuple or an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    models = (_inner_model(argument) for argument in get_args(annotation))
    return next((model for model in models if model is not None), None)
