"""Read a small YAML or JSON file that a person wrote; all its mistakes are reported with their lines."""

from collections.abc import Callable
from typing import Any

from pydantic import BaseModel, ValidationError

from glint.storage.catalogue.diagnostics import raise_diagnostics
from glint.storage.catalogue.messages import diagnostics_of
from glint.storage.catalogue.yaml_lines import Kind, parse
from glint.storage.errors import InputError
from glint.storage.locations.input_files import MAX_TEXT_BYTES, read_bytes
from glint.storage.locations.location import Location


def read_yaml_file[T](
    location: Location, kind: Kind, validate: Callable[[Any], T], model: type[BaseModel]
) -> tuple[Any, T]:
    """Return the content of a file with its lines, and what `validate` makes of it.

    kind: of the file; model: of what the file holds, for messages.

    Raises:
        InputError: the file is missing, too large, no text or of another kind, or `validate` raises a ValidationError.
    """
    data = read_bytes(location, MAX_TEXT_BYTES)
    try:
        root, diagnostics = parse(data.decode("utf-8-sig"), location.uri, kind)
    except UnicodeDecodeError as error:
        raise InputError(f"{location.uri} is not UTF-8 text", "name a text file, saved as UTF-8") from error
    raise_diagnostics(diagnostics)
    try:
        return root, validate(root)
    except ValidationError as error:
        raise_diagnostics(diagnostics_of(error, root, model, location.uri))
        raise
