"""Image stabilization: the translation of each frame against a reference, on which most blocks of the image agree.

Sphere and highlights must be located to a fraction of a pixel, since a shift of one pixel turns normals by a degree or
two. On a tripod only the light moves; but its highlights, the shadows of sphere and object and the caustics beside the
glass move too, and shading changes. Each block of the image is therefore registered by itself (Lucas and Kanade 1981,
Gauss-Newton) by its fine structure (band-pass), and a shake is what most blocks, on all sides of the image, agree on.
Of a frame without such a consensus nothing is known.
"""

from dataclasses import dataclass

import cv2
import numpy as np

DENOISING_SIGMA_PX, BACKGROUND_SIGMA_PX = 0.8, 3.0
"""Standard deviations of the band-pass: noise below the first, brightness that follows the light above the second."""
BLOCK_PX = 32
"""Side of the blocks that are registered by themselves."""
MIN_BLOCKS = 6
"""Blocks of sufficient structure below which nothing is known of a translation."""
MIN_BACKGROUND_BLOCKS = 12
"""Blocks of structure beside object and spheres from which those on them are not needed."""
MIN_STRUCTURE = 0.2
"""Smaller eigenvalue of a block's structure tensor per pixel, in squared levels, from which it shows a translation
along both axes; what noise and codec leave in a median of frames is a tenth of it."""
MIN_CORRELATION = 0.5
"""Correlation with the reference from which a block shows the same thing: a shadow's edge or a caustic does not."""
AGREEMENT_PX = 0.5
"""Difference from the consensus up to which a block agrees with it."""
MIN_AGREEMENT = 0.5
"""Share of the blocks with structure that must agree, in the whole image and in three of its quarters."""
MIN_REGISTERED = 0.6
"""Share of the frames that must find a consensus."""
MAX_REFERENCES = 3
"""References to which all frames are registered, one after the other."""
MIN_REFERENCE_FRAMES = 5
"""Least number of registered frames whose median is a reference."""
MAX_GAUSS_NEWTON_STEPS, CONVERGED_STEP_PX = 8, 0.01
"""Limit of the steps that refine a translation, and the size of a step below which it has settled."""
STILL_AGREEMENT = 0.8
"""Share of the blocks with structure that agree on a frame's having stood still, without a search farther off."""
MAX_SHIFT_PX = 16
"""Largest translation that the search in whole pixels covers."""
CLIPPED_DEVIATIONS = 3.0
"""Standard deviations of a block's structure to which differences are clipped, so that a highlight does not decide."""


@dataclass(frozen=True, slots=True)
class Consensus:
    """A translation (2,), and the number of blocks that agree with it; 0 without a consensus."""

    translation: np.ndarray
    blocks: int


class TranslationEstimator:
    """Estimates translations against a reference image (H, W) of the same scene; images are in levels of 8 bits.

    on_background: whether the blocks with structure outside of `excluded` suffice; otherwise all are used.
    """

    def __init__(self, reference: np.ndarray, excluded: np.ndarray | None = None) -> None:
        """Prepare the blocks of a reference.

        excluded: (H, W) bool, object and spheres: shading moves over them with the light.
        """
        self._reference = _band_pass(reference)
        down, right = np.gradient(self._reference)
        self._right, self._down = right, down
        self._size = min(BLOCK_PX, max(8, min(reference.shape) // 5))
        self._tensor = [self._blocks(values) for values in (right * right, right * down, down * down)]
        self._energy = self._blocks(self._reference**2)
        # With a level of quantization. One limit for the whole image would clip strong structure beside a plain table,
        # and so make its steps too small.
        self._limits = CLIPPED_DEVIATIONS * (np.sqrt(self._energy) / self._size + 1.0)
        a, b, d = self._tensor
        # The smaller eigenvalue: a single straight edge shows no translation along itself.
        smaller = 0.5 * (a + d) - np.sqrt(0.25 * (a - d) ** 2 + b**2)
        self._structured = smaller > MIN_STRUCTURE * self._size**2
        background = self._structured
        if excluded is not None:
            background = self._structured & (self._blocks(excluded.astype(np.float32)) == 0)
        self.on_background = bool(background.sum() >= MIN_BACKGROUND_BLOCKS)
        if self.on_background:
            self._structured = background
        rows, columns = np.indices(self._structured.shape)
        self._quarter = 2 * (2 * rows >= rows.max() + 1) + (2 * columns >= columns.max() + 1)

    def estimate(self, image: np.ndarray) -> np.ndarray | None:
        """Return the translation (2,) of an image (H, W) against the reference: pixels to the right and down.

        None without a consensus of the blocks.
        """
        consensus = self.consensus(image)
        return consensus.translation if consensus.blocks else None

    def consensus(self, image: np.ndarray) -> Consensus:
        """Return the translation of an image (H, W) with the number of blocks that agree."""
        if self._structured.sum() < MIN_BLOCKS:
            return Consensus(np.zeros(2), 0)
        detail = _band_pass(image)
        still = self._refined(detail, np.zeros(2))
        if still.blocks >= STILL_AGREEMENT * self._structured.sum():
            return still
        moved = self._refined(detail, self._in_whole_pixels(detail))
        return max(still, moved, key=lambda consensus: consensus.blocks)

    def _refined(self, detail: np.ndarray, translation: np.ndarray) -> Consensus:
        """Return the consensus of the blocks near a translation (2,)."""
        agreeing = self._structured
        for _ in range(MAX_GAUSS_NEWTON_STEPS):
            steps, alike = self._block_steps(translate(detail, -translation))
            # Blocks that agreed in the last round decide: the median of all is drawn towards shadows that drift.
            agreeing = alike if not (agreeing & alike).any() else agreeing & alike
            if not agreeing.any():
                return Consensus(np.zeros(2), 0)
            step = np.median(steps[agreeing], axis=0)
            agreeing = alike & (np.abs(steps - step).max(axis=-1) < AGREEMENT_PX)
            translation = translation + np.clip(step, -1.0, 1.0)
            if np.abs(step).max() < CONVERGED_STEP_PX:
                break
        if not self._is_consensus(agreeing):
            return Consensus(np.zeros(2), 0)
        return Consensus(translation + np.mean(steps[agreeing] - step, axis=0), int(agreeing.sum()))

    def _block_steps(self, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return by how much each block (R, C, 2) of an image (H, W) is still off, and whether it shows the same thing.

        A block's contrast follows the light, so it is fitted first.
        """
        product, energy = self._blocks(moved * self._reference), self._blocks(moved**2)
        contrast = np.maximum(product, 1e-6) / np.maximum(self._energy, 1e-6)
        correlation = product / np.sqrt(np.maximum(energy * self._energy, 1e-6))
        scale, limit = (self._in_pixels(values) for values in (1.0 / np.clip(contrast, 0.1, 10.0), self._limits))
        residual = np.zeros_like(moved)
        height, width = scale.shape
        difference = moved[:height, :width] * scale - self._reference[:height, :width]
        residual[:height, :width] = difference.clip(-limit, limit)
        u, v = self._blocks(self._right * residual), self._blocks(self._down * residual)
        a, b, d = self._tensor
        determinant = np.maximum(a * d - b * b, 1e-6)
        steps = -np.stack([(d * u - b * v) / determinant, (a * v - b * u) / determinant], axis=-1)
        return steps, self._structured & (correlation > MIN_CORRELATION)

    def _is_consensus(self, agreeing: np.ndarray) -> bool:
        """Return whether blocks (R, C) that agree are most of those with structure, all over the image."""
        if agreeing.sum() < max(MIN_BLOCKS, MIN_AGREEMENT * self._structured.sum()):
            return False
        with_structure = np.bincount(self._quarter[self._structured], minlength=4)
        in_agreement = np.bincount(self._quarter[agreeing], minlength=4)
        present = with_structure > 0
        return bool(
            (in_agreement[present] >= MIN_AGREEMENT * with_structure[present]).sum() >= min(3, int(present.sum()))
        )

    def _blocks(self, values: np.ndarray) -> np.ndarray:
        """Return the sums (R, C) of an image (H, W) over blocks; what is left at the right and bottom is not used."""
        size = self._size
        rows, columns = values.shape[0] // size, values.shape[1] // size
        whole = values[: rows * size, : columns * size]
        return np.asarray(whole.reshape(rows, size, columns, size).sum(axis=(1, 3), dtype=np.float64))

    def _in_pixels(self, values: np.ndarray) -> np.ndarray:
        """Return the values (R, C) of blocks at each of their pixels."""
        return np.kron(values, np.ones((self._size, self._size), np.float32))

    def _in_whole_pixels(self, detail: np.ndarray) -> np.ndarray:
        """Return the whole-pixel translation (2,) at which the reference's middle correlates best with `detail`."""
        margin = min(MAX_SHIFT_PX, min(detail.shape) // 6)
        if margin < 1:
            return np.zeros(2)
        # Clipped, so that a highlight does not decide the correlation.
        limit = np.float32(np.median(self._limits[self._structured]))
        middle = self._reference[margin:-margin, margin:-margin]
        correlation = cv2.matchTemplate(detail.clip(-limit, limit), middle.clip(-limit, limit), cv2.TM_CCOEFF_NORMED)
        row, column = np.unravel_index(int(correlation.argmax()), correlation.shape)
        return np.array([column - margin, row - margin], float)


def downsample(picture: np.ndarray, factor: int) -> np.ndarray:
    """Return a picture (H, W) `factor` times smaller, by averaging over areas, in levels of 8 bits.

    picture: uint8 or uint16. Returns uint8, or float32 for 16 bits.
    """
    if factor > 1:
        height, width = picture.shape
        picture = cv2.resize(picture, (width // factor, height // factor), interpolation=cv2.INTER_AREA)
    # In levels of 16 bits, noise would pass for structure.
    return picture if picture.dtype == np.uint8 else picture.astype(np.float32) / np.float32(257.0)


def translate(image: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """Return an image (H, W) moved by `translation` (right, down) pixels, bilinearly; border pixels are repeated."""
    height, width = image.shape
    matrix = np.array([[1.0, 0.0, translation[0]], [0.0, 1.0, translation[1]]])
    return cv2.warpAffine(image, matrix, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def register(frames: np.ndarray, excluded: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Register frames (T, H, W) to one another.

    Args:
        frames: in order, in levels of 8 bits.
        excluded: see `TranslationEstimator`.

    Returns:
        The temporal median (H, W) float32 of the registered frames, and each frame's translation (T, 2) against it:
        pixels to the right and down, NaN without a consensus.
    """
    # The median of all frames has no highlights and shadows, but a large shake blurs it beyond recognition; one frame
    # is sharp. Against something that moves by itself, only neighbouring frames agree.
    reference = np.median(frames, axis=0).astype(np.float32)
    translations, is_single = _translations(frames, reference, excluded), False
    if _known(translations).mean() < MIN_REGISTERED:
        reference = frames[len(frames) // 2].astype(np.float32)
        translations, is_single = _translations(frames, reference, excluded), True
    for _ in range(MAX_REFERENCES - 1):
        known = _known(translations)
        if known.sum() < MIN_REFERENCE_FRAMES:
            break
        if not is_single and np.abs(translations[known]).max() < AGREEMENT_PX:
            break
        # The median of the registered frames is a sharper reference than that of the shaken ones, and has less noise
        # than one frame.
        pairs = zip(frames[known], translations[known], strict=True)
        reference = np.median([translate(frame, -translation) for frame, translation in pairs], axis=0)
        reference, is_single = reference.astype(np.float32), False
        translations = _translations(frames, reference, excluded)
    return reference, translations


def _known(translations: np.ndarray) -> np.ndarray:
    """Return which of some translations (T, 2) are known, (T,) bool."""
    return np.isfinite(translations[:, 0])


def _translations(frames: np.ndarray, reference: np.ndarray, excluded: np.ndarray | None) -> np.ndarray:
    """Return the translation (T, 2) of each frame (T, H, W) against a reference, NaN without a consensus."""
    estimator = TranslationEstimator(reference, excluded)
    agreed = [estimator.consensus(frame) for frame in frames]
    return np.array([consensus.translation if consensus.blocks else (np.nan, np.nan) for consensus in agreed])


def _band_pass(image: np.ndarray) -> np.ndarray:
    image = image.astype(np.float32)
    smooth = cv2.GaussianBlur(image, (0, 0), DENOISING_SIGMA_PX)
    return smooth - cv2.GaussianBlur(image, (0, 0), BACKGROUND_SIGMA_PX)
