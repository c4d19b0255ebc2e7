"""Validation errors in words: which line, what is wrong with which value, the nearest known key."""

import difflib
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from glint.storage.catalogue.diagnostics import Problem, quoted
from glint.storage.catalogue.yaml_lines import line_of

_REMEDIES = {
    "string_type": "write text, in quotes if it looks like a number",
    "float_type": "write a number without quotes",
    "int_type": "write a whole number without quotes",
    "int_from_float": "write a whole number",
    "bool_type": "write true or false",
    "tuple_type": "write a list: [..]",
    "list_type": "write a list: [..]",
    "model_type": "write keys and values",
    "dict_type": "write keys and values",
    "finite_number": "write a finite number",
    "pose": "give exactly one of the two",
    "schema": "write `schema: 1`",
}
"""By pydantic's name of the error."""


def problems_of(error: ValidationError, root: Any, model: type[BaseModel], file: str) -> list[Problem]:
    """One problem per error; those of unknown keys name the nearest known one."""
    details = error.errors(include_url=False)
    return [_problem(detail, root, model, file) for detail in details if not _echoes(detail)]


def _echoes(detail: ErrorDetails) -> bool:
    """Whether it says again what is told better: a list is too short only because its items were found wrong; rules
    between keys, which the reader of the file tells with both lines."""
    if detail["type"] in ("duplicate_id", "spheres_and_lights"):
        return True
    context = detail.get("ctx", {})
    return detail["type"] == "too_short" and len(detail["input"]) >= context.get("min_length", 1)


def _problem(detail: ErrorDetails, root: Any, model: type[BaseModel], file: str) -> Problem:
    location = tuple(detail["loc"])
    line = line_of(root, location)
    where = _name(location)
    kind = detail["type"]
    if kind == "extra_forbidden":
        known = _keys_at(model, location[:-1])
        near = difflib.get_close_matches(str(location[-1]), known, 1, 0.5)
        remedy = f"did you mean {near[0]!r}?" if near else f"known keys are {', '.join(known)}"
        return Problem(file, line, f"unknown key {quoted(location[-1])} in {_name(location[:-1])}", remedy)
    if kind == "missing":
        return Problem(file, line, f"{where} is missing", "add it")
    if kind == "string_pattern_mismatch" and location[-1] == "id":
        remedy = "1 to 64 of a-z, 0-9, '.', '_' and '-', the first a letter or digit"
        return Problem(file, line, f"{where} {quoted(detail['input'])} is no id", remedy)
    if kind in ("pose", "camera", "schema"):
        return Problem(file, line, detail["msg"], _REMEDIES.get(kind, "mend the value"))
    message = detail["msg"][:1].lower() + detail["msg"][1:]
    return Problem(
        file, line, f"{where} is {quoted(detail['input'])}: {message}", _REMEDIES.get(kind, "mend the value")
    )


def _name(location: tuple[int | str, ...]) -> str:
    """objects[3].captures[0].region.x, counted from 0."""
    text = ""
    for step in location:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else str(step)
    return text or "the file"


def _keys_at(model: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """Keys that the model knows at a path."""
    here: Any = model
    for step in location:
        if isinstance(step, str) and isinstance(here, type) and issubclass(here, BaseModel):
            field = next((f for name, f in here.model_fields.items() if step in (name, f.alias)), None)
            if field is None:
                return []
            here = _model_in(field.annotation)
    if not (isinstance(here, type) and issubclass(here, BaseModel)):
        return []
    return [field.alias or name for name, field in here.model_fields.items()]


def _model_in(annotation: Any) -> Any:
    """The model inside an optional, a tuple or an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for part in get_args(annotation) if (found := _model_in(part)) is not None), None)
