import numpy as np
import pytest

from glint.tasks.algorithms.sheets.integrability import shape_log_ratio, sheet_jacobian
from tests.tasks.algorithms.geometry.gradient_normals import from_gradients

SIZE, RADIUS = 41, 40.0


def sheet(p: tuple[float, float], q: tuple[float, float]) -> np.ndarray:
    """A layer (1, H, W, 3) whose gradients p and q grow linearly: by so much per radius along x and y (up)."""
    rows, columns = (np.indices((SIZE, SIZE)) - (SIZE - 1) / 2) / RADIUS
    x, y = columns, -rows
    return from_gradients(p[0] * x + p[1] * y, q[0] * x + q[1] * y)[None].astype(np.float32)


def test_jacobian_of_a_linear_sheet_in_the_camera_frame() -> None:
    curl, size, convexity = sheet_jacobian(sheet((-1.0, 0.5), (0.2, -0.6)), 1)[0, 20, 20] * RADIUS
    assert curl == pytest.approx(0.3, abs=0.02)
    assert size == pytest.approx(np.sqrt(1 + 0.25 + 0.04 + 0.36), abs=0.02)
    assert convexity == pytest.approx(1.6, abs=0.02)


def test_the_jacobian_follows_the_sheet_through_the_layers() -> None:
    dome, bowl = sheet((-1.0, 0.0), (0.0, -1.0)), sheet((1.0, 0.0), (0.0, 1.0)) + np.array([0.4, 0.0, 0.0], np.float32)
    swap = np.random.default_rng(0).random((1, SIZE, SIZE, 1)) < 0.5
    layers = np.concatenate([np.where(swap, dome, bowl), np.where(swap, bowl, dome)])
    alone = sheet_jacobian(dome, 1)[0, 10, 10]
    layer = 0 if swap[0, 10, 10, 0] else 1
    assert np.allclose(sheet_jacobian(layers, 1)[layer, 10, 10], alone, atol=1e-4)


def test_convex_surfaces_are_exterior_and_concave_or_curled_sheets_are_not() -> None:
    middle = (0, 20, 20)
    dome = shape_log_ratio(sheet((-1.0, 0.0), (0.0, -1.0)), RADIUS)[middle]
    bowl = shape_log_ratio(sheet((1.0, 0.0), (0.0, 1.0)), RADIUS)[middle]
    curled = shape_log_ratio(sheet((-0.3, 1.0), (-1.0, -0.3)), RADIUS)[middle]
    assert dome > 2.0 and dome > bowl + 2.0 and dome > curled + 2.0 and curled < 0.0


def test_scraps_count_slightly_against() -> None:
    lonely = np.full((1, SIZE, SIZE, 3), np.nan, np.float32)
    lonely[0, 20, 20] = (0.0, 0.0, 1.0)
    ratio = shape_log_ratio(lonely, RADIUS)
    assert ratio[0, 20, 20] < 0 and np.isnan(ratio).sum() == SIZE * SIZE - 1


def test_gaps_in_the_window_do_not_change_the_jacobian() -> None:
    p, q = (-1.0, 0.5), (0.2, -0.6)
    layer = sheet(p, q)
    layer[:, np.random.default_rng(0).random((SIZE, SIZE)) < 0.6] = np.nan
    layer[:, 20:, :20] = np.nan
    curl, size, convexity = np.moveaxis(sheet_jacobian(layer, 1), -1, 0) * RADIUS
    known = np.isfinite(curl)
    assert known.sum() > 300
    assert curl[known] == pytest.approx(p[1] - q[0], abs=0.02)
    assert size[known] == pytest.approx(np.hypot(np.hypot(*p), np.hypot(*q)), abs=0.02)
    assert convexity[known] == pytest.approx(-p[0] - q[1], abs=0.02)
