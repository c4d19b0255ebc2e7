"""How much a view speaks for a faceted body: its silhouette, whole facets that flashed, and their rounded creases.

What flashes and creases say of a solid of flat faces is that of right prisms (`prism_evidence`). Of the many bodies
that are compared, a facet also must end where its flashes do, and the silhouette must be filled.
"""

import cv2
import numpy as np

from glint.tasks.algorithms.facets.crease_evidence import creases_log_ratio
from glint.tasks.algorithms.facets.facet_view import FacetView
from glint.tasks.algorithms.facets.faceted_body import FacetedBody
from glint.tasks.algorithms.prisms.prism_evidence import (
    ADDED_EDGE_PX,
    EDGE_INRADII,
    FALSE_FACE_SHARE,
    FLASHED_DEG,
    PIECE_INRADII,
    share_log_ratio,
)

UNFILLED_NATS = 4.0
"""What a piece of the silhouette that the body does not fill speaks against it."""


def facet_log_ratio(body: FacetedBody, view: FacetView) -> float:
    """Return the log-likelihood ratio, nats, of a view of this body against one of another object."""
    if not len(body.normals):
        return -np.inf
    faces = body.faces(view.mask.shape)
    piece = PIECE_INRADII * view.inradius
    unfilled = int((view.inner & (faces < 0)).sum())
    return float(
        _faces_log_ratio(body, faces, view) + creases_log_ratio(body, view) - UNFILLED_NATS * unfilled / piece**2
    )


def _faces_log_ratio(body: FacetedBody, faces: np.ndarray, view: FacetView) -> float:
    """Return what the insides of the visible faces, numbered (H, W), say."""
    count = len(body.normals)
    reach = round(EDGE_INRADII * view.inradius + ADDED_EDGE_PX)
    inside = faces.copy()
    inside[_near_edges(faces, reach) | ~view.mask] = -1
    normals, pixels = view.shown
    numbers = inside.ravel()[pixels]
    belongs = (normals * body.normals[numbers]).sum(axis=1) > np.cos(np.radians(FLASHED_DEG))
    flashes = np.zeros(faces.size, bool)
    flashes[pixels[belongs & (numbers >= 0)]] = True
    areas = np.bincount(inside[inside >= 0], minlength=count)
    shares = np.bincount(inside.ravel()[flashes], minlength=count) / np.maximum(areas, 1)
    ratios = share_log_ratio(shares, FALSE_FACE_SHARE)
    is_dark = ~view.flashing(body.normals, body.corners.mean(axis=1))
    ratios = np.where((ratios < 0.0) & is_dark, 0.0, ratios)
    return float((ratios * np.sqrt(areas)).sum() / (PIECE_INRADII * view.inradius))


def _near_edges(faces: np.ndarray, reach: int) -> np.ndarray:
    """Return the pixels (H, W) bool within `reach` pixels of one that belongs to another face."""
    high, low = (morph(faces, np.ones((3, 3), np.uint8)) for morph in (cv2.dilate, cv2.erode))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach - 1, 2 * reach - 1))
    return np.asarray(cv2.dilate((high != low).astype(np.uint8), disc) > 0)
