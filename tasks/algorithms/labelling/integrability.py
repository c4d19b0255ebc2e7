"""What a sheet's own shape says of it, whatever the expected field: does it integrate, and is it convex?

The gradients of a surface have no curl, and a solid's outside is mostly convex: its normals turn outwards. The half
vectors of a path through the glass need not integrate, and refraction mostly turns them the other way.
"""

import numpy as np
from numba import njit

REACH = np.cos(np.radians(15.0))
"""Nodes belong to one sheet while their normals differ by less, cosine."""
LEAST_SUPPORT = 8
CURL_SCALE = 0.1
"""Mean curl of exterior sheets, as a share of the Jacobian: noise and bumps smaller than the window."""
CURL_OUTLIERS = 0.15
CONVEX_MIDDLE, CONVEX_WIDTH, CONVEX_MOST = 0.5, 0.6, 1.65
"""Where, how fast and to how many nats convexity (in units of 1/inradius) turns from false to exterior."""


def shape_evidence(normals: np.ndarray, scale: float) -> np.ndarray:
    """Log likelihood ratio of exterior against false from the shape of each node's sheet.

    normals (K, H, W, 3), NaN without cluster; scale: the inradius in pixels -> (K, H, W) float32, NaN without cluster.
    Curl is exponential (with outliers) for exterior sheets and uniform for false ones. Scraps too small to have a shape
    count as slightly false.
    """
    curl, jacobian, convexity = np.moveaxis(sheet_jacobian(normals, max(1, round(scale / 100.0))), -1, 0)
    share = np.abs(curl) / (jacobian + 0.1 / scale)
    integrable = np.log((1.0 - CURL_OUTLIERS) / CURL_SCALE * np.exp(-share / CURL_SCALE) + CURL_OUTLIERS)
    convex = CONVEX_MOST * np.tanh((convexity * scale - CONVEX_MIDDLE) / CONVEX_WIDTH)
    ratio = np.where(np.isfinite(curl), integrable + convex, -2.0)
    return np.where(np.isfinite(normals[..., 0]), ratio, np.nan).astype(np.float32)


@njit(cache=True, nogil=True)
def sheet_jacobian(normals: np.ndarray, step: int) -> np.ndarray:
    """Curl p_y - q_x, norm of the Jacobian and convexity -(p_x + q_y) of the gradients about each node, per pixel.

    A plane is fitted to the gradients of the sheet that passes the node, in a window of 7 x 7 samples `step` pixels
    apart. normals (K, H, W, 3) -> (K, H, W, 3) float32, NaN where fewer than LEAST_SUPPORT samples hold the sheet.
    """
    layers, height, width, _ = normals.shape
    result = np.full((layers, height, width, 3), np.nan, np.float32)
    for k in range(layers):
        for y in range(height):
            for x in range(width):
                centre = normals[k, y, x]
                if np.isnan(centre[0]):
                    continue
                products = np.zeros((3, 3))
                sums = np.zeros((3, 2))
                support = 0
                for down in range(-3, 4):
                    for right in range(-3, 4):
                        v, u = y + down * step, x + right * step
                        if v < 0 or v >= height or u < 0 or u >= width:
                            continue
                        best, nearest = REACH, -1
                        for j in range(layers):
                            other = normals[j, v, u]
                            cosine = centre[0] * other[0] + centre[1] * other[1] + centre[2] * other[2]
                            if cosine > best:
                                best, nearest = cosine, j
                        if nearest < 0:
                            continue
                        support += 1
                        other = normals[nearest, v, u]
                        row = (1.0, float(right * step), float(-down * step))
                        for a in range(3):
                            for b in range(3):
                                products[a, b] += row[a] * row[b]
                            sums[a, 0] -= row[a] * other[0] / other[2]
                            sums[a, 1] -= row[a] * other[1] / other[2]
                if support < LEAST_SUPPORT:
                    continue
                for a in range(3):
                    products[a, a] += 1e-3
                plane = np.linalg.solve(products, sums)
                result[k, y, x, 0] = plane[2, 0] - plane[1, 1]
                result[k, y, x, 1] = np.sqrt((plane[1:] ** 2).sum())
                result[k, y, x, 2] = -plane[1, 0] - plane[2, 1]
    return result
