"""Ids made from the names of folders and files."""

import hashlib
import re
import unicodedata

MAX_ID_STEM = 56
"""Characters of a name that an id keeps: a number that tells it from others still fits."""
LETTERS = str.maketrans(
    {"ß": "ss", "æ": "ae", "œ": "oe", "ø": "o", "ł": "l", "đ": "d", "ð": "d", "þ": "th", "ı": "i", "ħ": "h"}
)
"""Latin letters that are no letter with an accent, and what is written without them."""


def id_from_name(name: str) -> str:
    """Return the nearest valid id: lower case, letters without accents, a hyphen for each run of other characters.

    A name of which nothing remains, as one in another script, has a digest for its id: the same one everywhere.
    """
    # Two systems may write one name in two forms, with letters and accents joined or not.
    letters = unicodedata.normalize("NFC", name).lower().translate(LETTERS)
    plain = "".join(sign for sign in unicodedata.normalize("NFKD", letters) if not unicodedata.combining(sign))
    digest = hashlib.sha256(unicodedata.normalize("NFC", name).encode(errors="surrogateescape")).hexdigest()
    return _joined(plain) or f"unnamed-{digest[:8]}"


def former_id(name: str) -> str:
    """Return the id under which stores may hold a name with accents, whose letters count as other characters there."""
    return _joined(name.lower()) or "capture"


def _joined(text: str) -> str:
    return re.sub(r"[^a-z0-9._-]+", "-", text).strip("-._")[:MAX_ID_STEM]
