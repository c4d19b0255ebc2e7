"""Levels as a codec shows them: each block stays behind the footage by up to some slack.

A codec transmits what has changed of a block only where it is worth its bits, so that a slowly changing level is
followed at a distance, from below while it rises and from above while it falls. That is backlash, the play operator of
hysteresis (Krasnosel'skii and Pokrovskii 1989).
"""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def held_back(levels: np.ndarray, slack: float) -> np.ndarray:
    """Return levels (T, N) of N places over time as they are shown with a slack, in levels.

    A level that rises is shown lower by the slack, one that falls higher; one that turns is shown as it is until it has
    come back by twice the slack.
    """
    shown = np.empty_like(levels)
    for place in range(levels.shape[1]):
        level = levels[0, place]
        for frame in range(levels.shape[0]):
            level = min(max(level, levels[frame, place] - slack), levels[frame, place] + slack)
            shown[frame, place] = level
    return shown
