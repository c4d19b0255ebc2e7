"""Warnings of the stages: what contradicts the data or is not known, what causes it, and what it may cost."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

Cause = Literal["video", "camera", "sphere", "light", "mask", "highlights", "marks", "coverage", "views", "scale"]
"""Input of a capture that a warning is about."""


@dataclass(frozen=True, slots=True)
class StageWarning:
    """A warning of a stage.

    message: a sentence with the offending value and what to do; cause: the input that it is about; cost_deg: the error
    of the normals, in degrees, that the cause may have on the pixels that it affects; 0 if it has none.
    """

    message: str
    cause: Cause
    cost_deg: float = 0.0

    def __str__(self) -> str:
        """Return the message."""
        return self.message

    def to_json(self) -> dict[str, Any]:
        """Return the warning as JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, saved: Mapping[str, Any]) -> "StageWarning":
        """Return the warning that `to_json` wrote."""
        return cls(saved["message"], saved["cause"], saved["cost_deg"])


def by_cost(warnings: Iterable[StageWarning]) -> list[StageWarning]:
    """Return one warning for each cause, the most costly first.

    Warnings of one cause are one: their messages in the order of their costs, none twice, and the highest cost. What
    several of them end with after a semicolon, the remedy, is said once.
    """
    messages: dict[Cause, dict[str, None]] = {}
    costs: dict[Cause, float] = {}
    for warning in sorted(warnings, key=lambda warning: -warning.cost_deg):
        messages.setdefault(warning.cause, {})[warning.message] = None
        costs.setdefault(warning.cause, warning.cost_deg)
    return [StageWarning(_joined(list(messages[cause])), cause, costs[cause]) for cause in messages]


def _joined(messages: Sequence[str]) -> str:
    """Return messages as one; of those that end alike after their last semicolon, only the last has the end."""
    ends = [message.rpartition("; ")[2] for message in messages]
    sentences = [
        message.removesuffix(f"; {end}") if end in ends[number + 1 :] else message
        for number, (message, end) in enumerate(zip(messages, ends, strict=True))
    ]
    return "; ".join(sentences)
