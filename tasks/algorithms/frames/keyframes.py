"""Selection of keyframes on which a user marks highlights (section 4.1 of Yeung et al. 2009).

The frames are spread over the light's sweep by farthest-point sampling (Gonzalez 1985) of their half vectors.
"""

import numpy as np


def keyframes(half_vectors: np.ndarray, lit: np.ndarray, count: int = 8) -> list[int]:
    """Return up to `count` frames, in order, spread over the light's sweep among those with most highlights.

    Args:
        half_vectors: (T, 3), NaN where the frame was rejected.
        lit: (T,) number of the object's lit pixels.
        count: number of frames wanted; fewer if fewer are usable, or have different lights.
    """
    usable = np.flatnonzero(np.isfinite(half_vectors[:, 0]) & (lit > 0))
    if len(usable) == 0:
        return []
    usable = usable[lit[usable] >= np.median(lit[usable])]
    # Farthest-point sampling: each further frame has the largest distance to the nearest of those chosen.
    chosen = [int(usable[lit[usable].argmax()])]
    distance = np.linalg.norm(half_vectors[usable] - half_vectors[chosen[0]], axis=1)
    while len(chosen) < count and distance.max() > 0.0:
        farthest = int(usable[distance.argmax()])
        chosen.append(farthest)
        distance = np.minimum(distance, np.linalg.norm(half_vectors[usable] - half_vectors[farthest], axis=1))
    return sorted(chosen)
