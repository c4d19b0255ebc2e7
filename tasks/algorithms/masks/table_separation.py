"""Object and table of a bare video, separated by how pixels respond to the light.

A graph cut separates the pixels whose response differs from that of the table around them (`table_response`); where the
table is follows from the object, and so on. Holes and gaps that are glass are filled (`mask_regions`).
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.convex_hull import convex_hull
from glint.tasks.algorithms.geometry.grid_cut import grid_cut, links
from glint.tasks.algorithms.masks.mask_regions import CLOSE_SHARE, bridged, filled, main_components, without_specks
from glint.tasks.algorithms.table.table_model import TableModel, fit_table
from glint.tasks.algorithms.table.table_response import TableResponse

MASK_REMEDY = "paint a mask (white object on black) and name it as `mask: mask.png`, or give the object's `region`"
ROUNDS = 3
"""Times that object and table around it are separated."""
DISTANCE_THRESHOLD, STRONG_DISTANCE = 9.0, 16.0
"""Squared Mahalanobis distance from the table at which object and table are equally likely, and from which a pixel
differs whatever its neighbours do: lines of highlights are a pixel wide."""
MAX_RATIO = 5.0
"""Bound of the log-likelihood ratio of a pixel, nats: a surprise is no proof."""
FEATURE_LIMITS = -4.0, 6.0
"""Bounds of the two features, which are log ratios: beyond them a pixel differs from the table in any case."""
FEATURE_SIGMA_PX = 0.6
"""Standard deviation of the smoothing before edges of the features are taken."""
CUT_STRENGTH, CUT_CONTRAST = 3.0, 0.5
"""Cost of the first cut per pixel of contour, nats, and the difference of log response that counts as an edge."""
RESPONSE_EDGE = 0.24
"""Difference of the saturated response that counts as an edge."""
MIN_HIGHLIGHT_PX = 12
"""Pixels with highlights below which there is no object."""
MAX_HIGHLIGHT_SHARE = 0.9
"""Share of the picture beyond which what flashes is not taken for highlights."""
MIN_GAP_PX, MIN_GAP_SHARE, MAX_GAP_PX, MAX_GAP_SHARE = 3.0, 0.02, 20.0, 0.4
"""Distances from the object between which the table is sampled, in pixels and as a share of the square root of the
object's area, whichever is more: beyond the blur of the contour, and where the light is still the same."""
MIN_TABLE_PX = 50
"""Pixels of the table around the object below which the frame's border is taken for the table."""


@dataclass(frozen=True, slots=True)
class Separation:
    """Object and table as the responses separate them.

    differing: (H, W) bool, pixels that differ from the table. filled: with gaps and holes that are glass. bridged: what
    a contour with gaps encloses. features: (H, W, 2), log responses. ratios: (H, W), log-likelihood ratios, nats.
    is_table: (H, W) bool, pixels of the table around the object. table: its model.
    """

    differing: np.ndarray
    filled: np.ndarray
    bridged: np.ndarray
    features: np.ndarray
    ratios: np.ndarray
    is_table: np.ndarray
    table: TableModel

    def within(self, window: tuple[slice, slice]) -> "Separation":
        """Return the separation in a window of the picture."""
        arrays = ("differing", "filled", "bridged", "features", "ratios", "is_table")
        return replace(self, table=self.table.within(window), **{name: getattr(self, name)[window] for name in arrays})

    @property
    def difference(self) -> np.ndarray:
        """How much pixels (H, W) differ from the table, nats; small where they are like it, as clear glass is too."""
        return np.asarray(self.ratios + DISTANCE_THRESHOLD / 2.0)

    @property
    def responses(self) -> list[np.ndarray]:
        """Both responses (H, W), on a scale on which their edge lies halfway between the object's and the table's."""
        images = []
        for channel in range(2):
            excess = self.features[..., channel] - self.table.mean[..., channel]
            reference = max(float(np.exp(np.median(excess[self.differing]))) - 1.0, 1.0)
            ratio = np.exp(excess.clip(-1.0, 5.0)) - 1.0
            images.append(ratio / (np.abs(ratio) + reference) / RESPONSE_EDGE)
        return images


def separate(response: TableResponse, free: np.ndarray, allowed: np.ndarray) -> Separation:
    """Separate object and table, beginning with the frame's border as the table.

    free, allowed: (H, W) bool, pixels beside the spheres, and those of them that may be the object.

    Raises:
        UnusableCapture: no pixel shows a highlight, or nearly all do.
    """
    features = np.clip(np.stack([response.deviation, response.flash], axis=-1), *FEATURE_LIMITS).astype(np.float32)
    images = [
        cv2.GaussianBlur(channel, (0, 0), FEATURE_SIGMA_PX) / CUT_CONTRAST for channel in np.moveaxis(features, -1, 0)
    ]
    capacities = links(images, CUT_STRENGTH, gaussian=True)
    is_table, root_area = response.border, None
    for _ in range(ROUNDS):
        table = fit_table(features, is_table, root_area)
        highlights = table.flashing(features)
        flashing = highlights & allowed
        _check_highlights(flashing, allowed)
        distance = table.distance(features)
        ratios = np.clip((distance - DISTANCE_THRESHOLD) / 2.0, -MAX_RATIO, MAX_RATIO)
        if root_area is None:
            # Shadows differ from the table far away as well: at first highlights alone are the object.
            differing = main_components(flashing, flashing, response.moment)
        else:
            differing = grid_cut(ratios, capacities, np.zeros_like(free), ~allowed) & allowed
            strong = without_specks((distance > STRONG_DISTANCE) & allowed)
            differing = main_components(differing | strong, flashing, response.moment)
        mask = filled(differing, CLOSE_SHARE)
        enclosed = bridged(differing, mask)
        # Parts of the object without highlights lie between those with them, not in the table's sample.
        covered = mask | enclosed if root_area is not None else convex_hull(mask)
        root_area = float(np.sqrt(max(int(differing.sum()), 1)))
        gap = ndimage.distance_transform_edt(~covered)
        is_table = (
            (gap > max(MIN_GAP_PX, MIN_GAP_SHARE * root_area))
            & (gap < max(MAX_GAP_PX, MAX_GAP_SHARE * root_area))
            & free
        )
        is_table &= ~ndimage.binary_dilation(highlights, np.ones((3, 3)))
        if is_table.sum() < MIN_TABLE_PX:
            is_table = response.border
    return Separation(differing, mask | enclosed, enclosed, features, ratios, is_table, table)


def _check_highlights(flashing: np.ndarray, allowed: np.ndarray) -> None:
    """Refuse a picture without highlights, or one full of them; flashing, allowed: (H, W) bool, see `separate`.

    Raises:
        UnusableCapture: as `separate`.
    """
    count = int(flashing.sum())
    if count < MIN_HIGHLIGHT_PX:
        raise UnusableCapture(f"no highlight, {count} of {allowed.sum()} pixels flash more than the table", MASK_REMEDY)
    if count > MAX_HIGHLIGHT_SHARE * allowed.sum():
        raise UnusableCapture(f"{count / allowed.sum():.0%} of {allowed.sum():,} pixels show a highlight", MASK_REMEDY)
