"""Limits of the search for a height with steps."""

from dataclasses import dataclass

SHARPNESS = 2.0
"""Final slope of the sigmoid between a pixel's two sides, per square pixel along the normal."""
MAX_ROUNDS = 30
"""Limit of an attempt's reweighted solutions."""
TOLERANCE_PX = 5e-3
"""Root mean square change of the height in a round below which the rounds end."""
MAX_SEARCHED_PIXELS = 300_000
"""Pixels of a mask up to which its own grid is searched for steps: that takes three starts and up to a hundred rounds,
on a grid of 2.4 million pixels four to ten minutes."""


@dataclass(frozen=True, slots=True)
class SearchLimits:
    """How far the search for a height with steps goes.

    sharpness: see SHARPNESS. max_rounds: see MAX_ROUNDS. tolerance: see TOLERANCE_PX. max_searched: pixels, see
    MAX_SEARCHED_PIXELS.
    """

    sharpness: float = SHARPNESS
    max_rounds: int = MAX_ROUNDS
    tolerance: float = TOLERANCE_PX
    max_searched: int = MAX_SEARCHED_PIXELS


DEFAULT_LIMITS = SearchLimits()
