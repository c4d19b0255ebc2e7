"""Digests of JSON values, and seals: attributes that carry the checksum of themselves."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

SEAL = "seal"
"""Attribute that holds the checksum of all others."""

HEX_DIGITS = 32
"""Length of a checksum: 128 bits of a SHA-256, which no two different contents of a store share by accident."""


def digest_of(value: Any) -> str:
    """Return the SHA-256 (hex) of a JSON value by its content: the order of keys does not matter.

    Raises:
        ValueError: NaN or infinity; TypeError: a type that JSON lacks.
    """
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def sealed(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return JSON attributes with their seal."""
    return {**attributes, SEAL: _seal_of(attributes)}


def is_sealed(attributes: Mapping[str, Any]) -> bool:
    """Return whether attributes are those that were sealed."""
    return SEAL in attributes and attributes[SEAL] == _seal_of(attributes)


def _seal_of(attributes: Mapping[str, Any]) -> str:
    content = {name: value for name, value in attributes.items() if name != SEAL}
    try:
        return digest_of(content)[:HEX_DIGITS]
    except ValueError:  # NaN, which no attribute that was sealed has
        return ""
