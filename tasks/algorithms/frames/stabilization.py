"""Image stabilization: the translation of each frame against a reference (Lucas and Kanade 1981, Gauss-Newton).

Sphere and highlights must be located to a fraction of a pixel, since a shift of one pixel turns normals by a degree or
two. On a tripod only the light moves; the edges of background, table and object do not. Frames are therefore compared
by their fine structure alone (band-pass), and pixels with large residuals, such as moving highlights, are excluded.
"""

import cv2
import numpy as np

DENOISING_SIGMA_PX, BACKGROUND_SIGMA_PX = 0.8, 3.0
"""Standard deviations of the band-pass: noise below the first, brightness that follows the light above the second."""
MAX_GAUSS_NEWTON_STEPS = 6
MAX_SHIFT_PX = 16
"""Largest translation that the search in whole pixels covers."""
EDGE_PERCENTILE = 60.0
"""Percentile of the gradient's magnitude above which a pixel counts as an edge."""
INLIER_NOISE_RATIO = 3.0
"""Residuals up to this many noise levels are inliers."""
MIN_INLIERS = 50
CONVERGED_STEP_PX = 0.01


class TranslationEstimator:
    """Estimates translations against a reference image (H, W) of the same scene."""

    def __init__(self, reference: np.ndarray) -> None:
        self._reference = _band_pass(reference)
        down, right = np.gradient(self._reference)
        magnitude = np.hypot(right, down)
        self._edges = magnitude > max(float(np.percentile(magnitude, EDGE_PERCENTILE)), 0.1)
        self._gradients = np.stack([right[self._edges], down[self._edges]], axis=-1)
        self._noise = 1.5 * float(np.median(np.abs(self._reference))) + 1.0

    def estimate(self, image: np.ndarray) -> np.ndarray:
        """Return the translation (2,) of an image (H, W) against the reference: pixels to the right and down."""
        image = image.astype(np.float32)
        translation = self._in_whole_pixels(_band_pass(image))
        for _ in range(MAX_GAUSS_NEWTON_STEPS):
            # Residuals at the reference's edges, with the image moved back by the present estimate.
            residuals = (_band_pass(translate(image, -translation)) - self._reference)[self._edges]
            # Moving highlights and shadows would pull the estimate: leave out what differs by more than noise.
            inliers = np.abs(residuals) < INLIER_NOISE_RATIO * self._noise
            if inliers.sum() < MIN_INLIERS:
                break
            gradients = self._gradients[inliers]
            normal = gradients.T @ gradients
            # A little damping keeps the system solvable where all edges have one direction.
            step = -np.linalg.solve(normal + 1e-6 * np.trace(normal) * np.eye(2), gradients.T @ residuals[inliers])
            # The linearization holds within about a pixel, so longer steps are clipped.
            translation = translation + np.clip(step, -1.0, 1.0)
            if np.abs(step).max() < CONVERGED_STEP_PX:
                break
        return translation

    def _in_whole_pixels(self, detail: np.ndarray) -> np.ndarray:
        """Return the whole-pixel translation (2,) at which the reference's middle correlates best with `detail`."""
        margin = min(MAX_SHIFT_PX, min(detail.shape) // 6)
        if margin < 1 or not self._edges.any():
            return np.zeros(2)
        # Clipped, so that a highlight does not decide the correlation.
        limit = INLIER_NOISE_RATIO * self._noise
        middle = self._reference[margin:-margin, margin:-margin]
        correlation = cv2.matchTemplate(detail.clip(-limit, limit), middle.clip(-limit, limit), cv2.TM_CCOEFF_NORMED)
        row, column = np.unravel_index(int(correlation.argmax()), correlation.shape)
        return np.array([column - margin, row - margin], float)


def downsample(picture: np.ndarray, factor: int) -> np.ndarray:
    """Return a picture (H, W) `factor` times smaller, by averaging over areas."""
    if factor <= 1:
        return picture
    height, width = picture.shape
    return cv2.resize(picture, (width // factor, height // factor), interpolation=cv2.INTER_AREA)


def translate(image: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """Return an image (H, W) moved by `translation` (right, down) pixels, bilinearly; border pixels are repeated."""
    height, width = image.shape
    matrix = np.array([[1.0, 0.0, translation[0]], [0.0, 1.0, translation[1]]])
    return cv2.warpAffine(image, matrix, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def register(frames: np.ndarray, iterations: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Register frames (T, H, W) to one another.

    Returns:
        The temporal median (H, W) float32 of the registered frames, and each frame's translation (T, 2) against it:
        pixels to the right and down.
    """
    reference, translations = np.median(frames, axis=0).astype(np.float32), np.zeros((len(frames), 2))
    # The first median is blurred by the shake; the one of the registered frames is a sharper reference.
    for _ in range(iterations):
        estimator = TranslationEstimator(reference)
        translations = np.array([estimator.estimate(frame) for frame in frames])
        registered = [translate(frame, -translation) for frame, translation in zip(frames, translations, strict=True)]
        reference = np.median(registered, axis=0).astype(np.float32)
    return reference, translations


def shake_amplitude(translations: np.ndarray) -> float:
    """Return the width in pixels of the middle nine tenths of translations (T, 2), the larger of x and y."""
    low, high = np.percentile(translations, (5.0, 95.0), axis=0)
    return float((high - low).max())


def _band_pass(image: np.ndarray) -> np.ndarray:
    image = image.astype(np.float32)
    smooth = cv2.GaussianBlur(image, (0, 0), DENOISING_SIGMA_PX)
    return smooth - cv2.GaussianBlur(image, (0, 0), BACKGROUND_SIGMA_PX)
