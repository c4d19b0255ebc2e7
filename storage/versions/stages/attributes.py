"""Attributes of a stage's group: key and record of the result, its files, and the checksums of all else, sealed.

A seal proves that attributes are whole, not that Glint wrote them: whoever makes a store can seal anything.
"""

from collections.abc import Callable, Mapping
from typing import Any

from glint.storage.seals import is_sealed

UNSEALED = "its attributes are not what was written"


def attributes_problem(attributes: Mapping[str, Any]) -> str:
    """Return why these cannot be the attributes of a stage's group, empty where they can."""
    if not is_sealed(attributes):
        return UNSEALED
    unusable = [f"`{name}`" for name, is_usable in _USABLE.items() if not is_usable(attributes.get(name))]
    return f"its attributes have no {', '.join(unusable)} as Glint writes them" if unusable else ""


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_record(value: Any) -> bool:
    return isinstance(value, dict)


def _are_checksums(value: Any) -> bool:
    return isinstance(value, dict) and all(isinstance(checksum, str) for checksum in value.values())


def _are_files(value: Any) -> bool:
    return isinstance(value, dict) and all(map(_is_file, value.values()))


def _is_file(value: Any) -> bool:
    if not isinstance(value, dict) or value.keys() != {"size", "sha256", "media_type"}:
        return False
    return isinstance(value["size"], int) and isinstance(value["sha256"], str) and isinstance(value["media_type"], str)


_USABLE: Mapping[str, Callable[[Any], bool]] = {
    "name": _is_text,
    "key": _is_text,
    "record": _is_record,
    "files": _are_files,
    "checksums": _are_checksums,
}
"""What the attributes must have, and whether a value can be it."""
