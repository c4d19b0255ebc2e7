"""Handles of vessels: normals of what stands out beside a body of revolution, and goes on before it.

Between its own contours a handle's normals are those of a smooth field, since (n_x, n_y) is linear across a tube. Its
candidates go on that field before the body, and contradict the body there.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.distance import depth_inside, distance_inside, with_nearest
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.prior.smooth_normals import contour_normals, smooth_normal_field

HANDLE_PX = 2
"""Half of the least width of a handle; what is thinner is the staircase of the contour."""
ACCEPTED_WEIGHT = 0.1
"""Weight of a handle's own normal in its field, against a contour pixel's 1."""
TENSION_LENGTH = 1.0
"""Distance in inradii of a handle beyond which its field is no longer extrapolated linearly."""
CORNER_PX = 4.0
"""Distance to the body up to which a handle's contour is not used."""
GROWTH_SHARE, GROWTH_PX, MAX_GROWTH_STEPS = 0.3, 3, 24
"""Distance by which a handle is followed before the body in a step, in its inradii, and at least, in pixels; and the
number of steps."""
HANDLE_SHEET_DEG, BODY_SHEET_DEG = 16.0, 10.0
"""Angle to the handle's field up to which a candidate belongs to it, and to the body beyond which it is not that."""
MIN_JOINED_SHARE = 0.4
"""Share of the pixels around one that must belong to the handle too."""
MIN_FOLLOWED_SHARE = 0.02
"""Share of a handle that accepted normals show from which it is followed before the body: a part of the table that a
mask holds shows none, and false candidates of the body may go on from it."""
MIN_BODY_NZ = float(np.cos(np.radians(42.0)))
"""n_z of the body from which it would show highlights, so that it is covered where it does not."""
UNSEEN_SHARE = 0.4
"""Distance beyond a handle's observed normals up to which it may go on unobserved, in its inradii: a tube turns by 45
degrees over 0.7 radii."""


def handles_beside(mask: np.ndarray, body: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool of a silhouette that stand out beside its body, both (H, W) bool."""
    beside = mask & ~body
    return beside & ndimage.binary_dilation(ndimage.binary_opening(beside, iterations=HANDLE_PX), iterations=HANDLE_PX)


def with_handles(
    body: np.ndarray, handles: np.ndarray, mask: np.ndarray, accepted: np.ndarray, candidates: np.ndarray
) -> np.ndarray:
    """Return the normals of a body (H, W, 3) with those of its handles, beside it and before it.

    A handle that is observed is followed before the body as long as candidates go on its field and contradict the body,
    and the normals accepted there are not the body's. Where the body is too steep to show highlights, only false ones
    are seen of it, which may go on the field too: there the handle is followed no farther than across the steep pixels,
    or by its own inradius.

    Args:
        body: NaN where there is none; slivers beside it get the nearest of its normals.
        handles: (H, W) bool, beside the body.
        mask: (H, W) bool, the silhouette.
        accepted: (H, W, 3), normals of accepted highlights, NaN elsewhere.
        candidates: (K, H, W, 3), NaN where there is none.
    """
    result = with_nearest(body, mask)
    if not handles.any():
        return result
    radius = _nearest_inradius(handles)
    step = max(GROWTH_PX, round(GROWTH_SHARE * float(radius.max())))
    box = _surroundings(handles, MAX_GROWTH_STEPS * step)
    contour, outward = (array[box] for array in contour_normals(mask))
    handles, mask, candidates, radius = handles[box], mask[box], candidates[:, *box], radius[box]
    body, accepted = body[box], accepted[box]
    # Where a handle meets the body the silhouette's corner is rounded.
    contour = contour & (distance_inside(~(mask & ~handles)) > CORNER_PX)
    to_body = np.where(handles, 180.0, np.nan_to_num(angles(candidates, body[None]), nan=180.0))
    shows_body = to_body.min(axis=0, initial=180.0) < BODY_SHEET_DEG
    is_steep = mask & ~handles & ~(body[..., 2] > MIN_BODY_NZ)
    view = _HandleView(
        mask,
        contour,
        outward,
        candidates,
        to_body,
        is_body=np.nan_to_num(angles(accepted, body), nan=180.0) < BODY_SHEET_DEG,
        is_covered=mask & ~shows_body & ~is_steep,
        crossing=np.maximum(radius, 2.0 * depth_inside(is_steep).max()),
        step=step,
    )
    own, region = view.followed(np.where(handles[..., None], accepted, np.nan), handles)
    grown, region = region & ~handles, region | handles
    if grown.any():
        region = region | (mask & ~shows_body & (distance_inside(~grown) <= UNSEEN_SHARE * radius))
    result[box][region] = view.field(own, region)[region]
    return result


@dataclass(frozen=True, slots=True)
class _HandleView:
    """What is seen around the handles of a body.

    mask (H, W) bool, the silhouette; contour (H, W) bool, its pixels that bound handles; outward (H, W, 3), normals
    there. candidates (K, H, W, 3), NaN where there is none; to_body (K, H, W): their angle to the body in degrees, 180
    where either is missing. is_body (H, W) bool: whether the accepted normal is the body's; is_covered (H, W) bool:
    whether the body would show highlights, but none is seen. crossing (H, W): distance in pixels by which a handle is
    followed where that is not known; step: that of one step.
    """

    mask: np.ndarray
    contour: np.ndarray
    outward: np.ndarray
    candidates: np.ndarray
    to_body: np.ndarray
    is_body: np.ndarray
    is_covered: np.ndarray
    crossing: np.ndarray
    step: int

    def field(self, own: np.ndarray, region: np.ndarray) -> np.ndarray:
        """Return the smooth field (H, W, 3) of handles in a region (H, W) bool by their own normals, NaN elsewhere."""
        known = region & np.isfinite(own[..., 0])
        weights = np.where(known, ACCEPTED_WEIGHT, np.where(self.contour & region, 1.0, 0.0))
        surface = smooth_normal_field(region, TENSION_LENGTH)
        return surface.solve(np.where(known[..., None], own, self.outward), weights)

    def followed(self, own: np.ndarray, handles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Follow handles (H, W) bool before the body; return their own normals (H, W, 3) and the region that they fill.

        own: (H, W, 3), accepted normals of the handles, NaN elsewhere. Handles of which too few are known have no part.
        """
        beginning = region = _shown(handles, np.isfinite(own[..., 0]))
        for _ in range(MAX_GROWTH_STEPS if beginning.any() else 0):
            near = distance_inside(~(beginning | (region & self.is_covered))) <= self.crossing
            around = near & self.mask & ~self.is_body & np.isnan(own[..., 0]) & (distance_inside(~region) <= self.step)
            to_field = angles(self.candidates, self.field(own, region | around)[None])
            to_field = np.where(self.to_body > BODY_SHEET_DEG, np.nan_to_num(to_field, nan=180.0), 180.0)
            best = to_field.argmin(axis=0)[None]
            joins = around & (np.take_along_axis(to_field, best, axis=0)[0] < HANDLE_SHEET_DEG)
            # Among the candidates of other light paths some agree by chance, but not side by side.
            joins &= ndimage.uniform_filter((region | joins).astype(float), 2 * self.step - 1) > MIN_JOINED_SHARE
            if np.count_nonzero(joins & ~region) < self.step:
                break
            nearest = np.take_along_axis(self.candidates, best[..., None], axis=0)[0]
            own, region = np.where(joins[..., None], nearest, own), region | joins
        return own, region


def _surroundings(region: np.ndarray, margin: int) -> tuple[slice, slice]:
    """Return rows and columns of the rectangle around a region (H, W) bool, with a margin in pixels."""
    rows, columns = (
        slice(max(0, int(place.min()) - margin), int(place.max()) + margin + 1) for place in np.nonzero(region)
    )
    return rows, columns


def _shown(handles: np.ndarray, observed: np.ndarray) -> np.ndarray:
    """Return the handles (H, W) bool of which enough is observed, (H, W) bool."""
    numbers, count = ndimage.label(handles)
    shares = ndimage.mean(observed, numbers, np.arange(count + 1))
    return handles & (shares >= MIN_FOLLOWED_SHARE)[numbers]


def _nearest_inradius(handles: np.ndarray) -> np.ndarray:
    """Return the inradius (H, W) in pixels of the handle that is nearest to each pixel; handles: (H, W) bool."""
    numbers, count = ndimage.label(handles)
    depth = depth_inside(handles)
    nearest = ndimage.distance_transform_edt(~handles, return_distances=False, return_indices=True)
    return np.asarray(ndimage.maximum(depth, numbers, np.arange(1, count + 1)))[numbers[tuple(nearest)] - 1]
