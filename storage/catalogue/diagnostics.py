"""What is wrong with a file that a person wrote, told line by line and all at once."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from glint.storage.errors import InputError

_TOLD = 20
"""Problems of one file that are listed in full."""


@dataclass(frozen=True, slots=True)
class Problem:
    """What is wrong in which line (counted from 1) of a file, and what to do."""

    file: str
    line: int
    message: str
    remedy: str

    def __str__(self) -> str:
        """As compilers say it."""
        return f"{self.file}:{self.line}: {self.message}: {self.remedy}"


def raise_all(problems: Sequence[Problem]) -> None:
    """Raise one InputError for all problems, if there are any."""
    if problems:
        told = [f"{problem.file}:{problem.line}: {problem.message}" for problem in problems[:_TOLD]]
        more = [f"and {len(problems) - _TOLD} more"] if len(problems) > _TOLD else []
        remedies = dict.fromkeys(problem.remedy for problem in problems[:_TOLD])
        raise InputError("; ".join([*told, *more]), "; ".join(remedies))


def quoted(value: Any) -> str:
    """A value for a message, cut to a readable length."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
