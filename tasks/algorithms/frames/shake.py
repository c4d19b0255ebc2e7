"""Motion of a camera, by the translations of its frames: its amplitude, whether it is one, whether it was a knock."""

import numpy as np

MAX_STEP_SCATTER_PX = 0.35
"""Distance from the nearest of two places, in the mean, up to which a camera stood at the two and nowhere else."""
MAX_UNKNOWN_END_SHARE = 0.1
"""Share of the frames, at the beginning and at the end of a recording, that may show no place."""


def shake_amplitude(translations: np.ndarray) -> float:
    """Return the width in pixels of the middle nine tenths of translations (T, 2), the larger of x and y."""
    low, high = np.percentile(translations, (5.0, 95.0), axis=0)
    return float((high - low).max())


def is_shown_throughout(known: np.ndarray) -> bool:
    """Return whether the frames that show the camera's place, (T,) bool, reach from the beginning to the end.

    On what drifts by itself, such as a shadow, only the neighbours of one frame agree.
    """
    numbers, most = np.flatnonzero(known), MAX_UNKNOWN_END_SHARE * len(known)
    return len(numbers) > 0 and bool(numbers[0] <= most and len(known) - 1 - numbers[-1] <= most)


def knocked_places(translations: np.ndarray) -> np.ndarray | None:
    """Return the two places (2, 2) at which a camera stood before and after it was knocked; None if it shook otherwise.

    translations: (T, 2) in the order of the frames, pixels.
    """
    count = len(translations)
    if count < 4:
        return None
    # The change point whose two means leave the least scatter; the frame of the knock itself belongs to either side.
    splits = [
        np.abs(translations[:k] - np.median(translations[:k], axis=0)).sum()
        + np.abs(translations[k:] - np.median(translations[k:], axis=0)).sum()
        for k in range(1, count)
    ]
    split = 1 + int(np.argmin(splits))
    places = np.stack([np.median(part, axis=0) for part in (translations[:split], translations[split:])])
    return places if splits[split - 1] / (2 * count) < MAX_STEP_SCATTER_PX else None
