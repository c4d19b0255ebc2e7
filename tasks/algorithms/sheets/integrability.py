"""Integrability and convexity prior: a sheet's log-likelihood ratio from its own shape, independent of the field.

The gradients of a surface have no curl (integrability, Frankot and Chellappa 1988), and the outside of a solid is
mostly convex. Half vectors of a path through the glass need not integrate, and refraction mostly turns them inwards.
The paper leaves this cue unused: section 4.2 only ties neighbours of similar gradients.
"""

import numpy as np
from numba import njit

WINDOW_SHEET_COSINE = np.cos(np.radians(15.0))
"""A normal in the window belongs to the node's sheet if it differs from the node's by less than 15 degrees."""
MIN_WINDOW_SAMPLES = 8
"""Samples of the sheet that a fit of the Jacobian needs, of 49."""
RIDGE = 1e-3
"""Added to the diagonal of the normal equations, in squared pixels, so that samples in one line stay solvable."""
CURL_SCALE = 0.1
"""Mean curl of exterior sheets as a share of the Jacobian's norm, from noise and from bumps smaller than the window."""
CURL_OUTLIER_SHARE = 0.15
"""Share of exterior nodes whose curl is uniform instead."""
MIN_JACOBIAN_PER_INRADIUS = 0.1
"""Added to the Jacobian's norm, per inradius: the curl of a flat sheet is noise."""
CONVEXITY_MIDPOINT, CONVEXITY_WIDTH, CONVEXITY_MAX_NATS = 0.5, 0.6, 1.65
"""Centre and width (in 1/inradius) of the tanh that maps convexity to a log-likelihood ratio, and its bound."""
SCRAP_LOG_RATIO = -2.0
"""Nats for scraps that are too small to have a shape: more often false than exterior."""


def window_step(inradius: float) -> int:
    """Return the distance in pixels between the window's samples for a mask of that inradius in pixels."""
    return max(1, round(inradius / 100.0))


def shape_log_ratio(normals: np.ndarray, inradius: float) -> np.ndarray:
    """Compute the log-likelihood ratio of exterior against false from the shape of each node's sheet.

    Relative curl is exponential (with uniform outliers) for exterior sheets and uniform for false ones; the ratio of
    convexity is a tanh fitted to simulated captures.

    Args:
        normals: (K, H, W, 3) unit, camera frame, NaN without cluster.
        inradius: of the mask, in pixels.

    Returns:
        (K, H, W) float32, nats, NaN without cluster.
    """
    curl, jacobian, convexity = np.moveaxis(sheet_jacobian(normals, window_step(inradius)), -1, 0)
    relative_curl = np.abs(curl) / (jacobian + MIN_JACOBIAN_PER_INRADIUS / inradius)
    exterior = (1.0 - CURL_OUTLIER_SHARE) / CURL_SCALE * np.exp(-relative_curl / CURL_SCALE) + CURL_OUTLIER_SHARE
    integrable = np.log(exterior)
    convex = CONVEXITY_MAX_NATS * np.tanh((convexity * inradius - CONVEXITY_MIDPOINT) / CONVEXITY_WIDTH)
    ratio = np.where(np.isfinite(curl), integrable + convex, SCRAP_LOG_RATIO)
    return np.where(np.isfinite(normals[..., 0]), ratio, np.nan).astype(np.float32)


@njit(cache=True, nogil=True)
def sheet_jacobian(normals: np.ndarray, step: int) -> np.ndarray:
    """Fit the Jacobian of the gradients (p, q) of each node's sheet.

    By least squares over a window of 7 x 7 samples `step` pixels apart. normals (K, H, W, 3), camera frame, NaN without
    cluster -> (K, H, W, 3) float32, per pixel: curl p_y - q_x, Frobenius norm of the Jacobian, convexity -(p_x + q_y);
    NaN where fewer than MIN_WINDOW_SAMPLES samples hold the sheet.
    """
    layers, height, width, _ = normals.shape
    result = np.full((layers, height, width, 3), np.nan, np.float32)
    products, sums = np.zeros((3, 3)), np.zeros((3, 2))
    for k in range(layers):
        for y in range(height):
            for x in range(width):
                if np.isnan(normals[k, y, x, 0]):
                    continue
                support = _add_samples(normals, k, y, x, step, products, sums)
                if support < MIN_WINDOW_SAMPLES:
                    continue
                p_x, p_y, q_x, q_y = _slopes(products, sums)
                result[k, y, x, 0] = p_y - q_x
                result[k, y, x, 1] = np.sqrt(p_x**2 + p_y**2 + q_x**2 + q_y**2)
                result[k, y, x, 2] = -p_x - q_y
    return result


@njit(cache=True, nogil=True)
def _add_samples(normals: np.ndarray, k: int, y: int, x: int, step: int, products: np.ndarray, sums: np.ndarray) -> int:
    """Write the normal equations of the planes p, q = c0 + c1 x + c2 y about a node; return the number of its samples.

    products (3, 3), sums (3, 2): A^T A and A^T (p, q).
    """
    _, height, width, _ = normals.shape
    centre = normals[k, y, x]
    products[:] = 0.0
    sums[:] = 0.0
    support = 0
    for down in range(-3, 4):
        for right in range(-3, 4):
            v, u = y + down * step, x + right * step
            if v < 0 or v >= height or u < 0 or u >= width:
                continue
            layer = _layer_of_sheet(normals, v, u, centre)
            if layer < 0:
                continue
            support += 1
            normal = normals[layer, v, u]
            # Rows run downwards, y upwards.
            row = (1.0, float(right * step), float(-down * step))
            for a in range(3):
                for b in range(3):
                    products[a, b] += row[a] * row[b]
                sums[a, 0] -= row[a] * normal[0] / normal[2]
                sums[a, 1] -= row[a] * normal[1] / normal[2]
    return support


@njit(cache=True, nogil=True, inline="always")
def _layer_of_sheet(normals: np.ndarray, v: int, u: int, centre: np.ndarray) -> int:
    """Return the layer at pixel (v, u) in which the sheet of a normal (3,) goes on, -1 if it does not.

    Clusters are not sorted by sheet: it is the layer of the nearest normal.
    """
    max_cosine, nearest = WINDOW_SHEET_COSINE, -1
    for j in range(len(normals)):
        normal = normals[j, v, u]
        cosine = centre[0] * normal[0] + centre[1] * normal[1] + centre[2] * normal[2]
        if cosine > max_cosine:
            max_cosine, nearest = cosine, j
    return nearest


@njit(cache=True, nogil=True)
def _slopes(products: np.ndarray, sums: np.ndarray) -> tuple[float, float, float, float]:
    """Solve the normal equations of `_add_samples`: return p_x, p_y, q_x and q_y. A ridge is added to `products`."""
    for a in range(3):
        products[a, a] += RIDGE
    # By Cramer's rule: rows 1 and 2 of the inverse are cofactors over the determinant.
    a00, a01, a02 = products[0, 0], products[0, 1], products[0, 2]
    a11, a12, a22 = products[1, 1], products[1, 2], products[2, 2]
    along_x = (a02 * a12 - a01 * a22, a00 * a22 - a02 * a02, a01 * a02 - a00 * a12)
    along_y = (a01 * a12 - a02 * a11, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01)
    determinant = a00 * (a11 * a22 - a12 * a12) + a01 * along_x[0] + a02 * along_y[0]
    p_x = p_y = q_x = q_y = 0.0
    for a in range(3):
        p_x += along_x[a] * sums[a, 0] / determinant
        q_x += along_x[a] * sums[a, 1] / determinant
        p_y += along_y[a] * sums[a, 0] / determinant
        q_y += along_y[a] * sums[a, 1] / determinant
    return p_x, p_y, q_x, q_y
