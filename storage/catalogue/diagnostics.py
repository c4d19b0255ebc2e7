"""Errors in a file that a person wrote: line by line, reported all at once."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from glint.storage.errors import InputError

_MAX_LISTED = 20
"""Errors of one file that are listed in full."""
_MAX_ALIKE = 5
"""Errors of one file with the same remedy that are listed: a column too many is in every row."""
_MAX_REPR = 60
"""Characters of a value in a message."""


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """An error in a line (counted from 1) of a file, and its remedy."""

    file: str
    line: int
    message: str
    remedy: str

    def __str__(self) -> str:
        """Format it as compilers do."""
        return f"{self.file}:{self.line}: {self.message}: {self.remedy}"


def raise_diagnostics(diagnostics: Sequence[Diagnostic]) -> None:
    """Raise one InputError for all diagnostics of a file, if there are any."""
    if diagnostics:
        listed, alike = list[Diagnostic](), Counter[str]()
        for diagnostic in diagnostics:
            alike[diagnostic.remedy] += 1
            if alike[diagnostic.remedy] <= _MAX_ALIKE and len(listed) < _MAX_LISTED:
                listed.append(diagnostic)
        messages = [f"{diagnostic.file}:{diagnostic.line}: {diagnostic.message}" for diagnostic in listed]
        if len(diagnostics) > len(listed):
            messages.append(f"and {len(diagnostics) - len(listed)} more")
        remedies = dict.fromkeys(diagnostic.remedy for diagnostic in listed)
        raise InputError("; ".join(messages), "; ".join(remedies))


def truncate_repr(value: Any) -> str:
    """Return a value's repr for a message, cut to a readable length."""
    text = repr(value)
    return text if len(text) <= _MAX_REPR else text[: _MAX_REPR - 3] + "..."
