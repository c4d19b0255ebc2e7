"""Masks of images whose object is known."""

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.frames.mask import estimate_mask
from glint.tasks.algorithms.lighting.spheres import Sphere


def scene(width: int = 260, height: int = 180) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return median and maximum of a glass ring beside a sphere on a textured table, and the ring's mask."""
    generator = np.random.default_rng(0)
    median = cv2.GaussianBlur(generator.normal(45, 20, (height, width)).astype(np.float32), (0, 0), 3) + 5
    rows, columns = np.mgrid[:height, :width]
    distance = np.hypot(columns - 90, rows - 90)
    ring = (distance < 62) & (distance > 26)
    maximum = median + 40 * np.exp(-(((columns - 90) / 90) ** 2))
    highlights = cv2.GaussianBlur(generator.normal(0, 1, (height, width)).astype(np.float32), (0, 0), 1.5) > -0.05
    maximum = np.where(ring & highlights, 255.0, np.where(ring, maximum + 60, maximum))
    maximum[np.hypot(columns - 210, rows - 90) < 20] = 255.0
    return median, maximum.astype(np.float32), ring


def overlap(found: np.ndarray, expected: np.ndarray) -> float:
    return float((found & expected).sum() / (found | expected).sum())


def test_the_object_is_found_with_its_hole_and_without_the_sphere() -> None:
    median, maximum, ring = scene()
    found = estimate_mask(median, maximum, spheres=[Sphere(210, 90, 28)])
    assert overlap(found, ring) > 0.92
    assert not found[80:100, 80:100].any() and not found[:, 180:].any()


def test_large_images_are_reduced() -> None:
    median, maximum, ring = (cv2.resize(image.astype(np.float32), None, fx=5, fy=5) for image in scene())
    assert overlap(estimate_mask(median, maximum, spheres=[Sphere(1050, 450, 140)]), ring > 0.5) > 0.92


def test_images_without_highlights_are_refused() -> None:
    median, _, _ = scene()
    with pytest.raises(UnusableCapture, match="no highlight"):
        estimate_mask(median, median + 2)
    with pytest.raises(UnusableCapture, match="show a highlight"):
        estimate_mask(median * 0, median * 0 + 255)
    with pytest.raises(ValueError, match="shapes"):
        estimate_mask(median, median[:5])
