import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.vessels.handles import handles_beside, with_handles


def pixels() -> tuple[np.ndarray, np.ndarray]:
    return tuple(np.meshgrid(np.arange(140) - 69.5, 99.5 - np.arange(200)))


Scene = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def cylinder_with_handle() -> Scene:
    """Normals of an upright cylinder, and with a level tube that begins before it; pixels of cylinder and tube."""
    x, y = pixels()
    body, handle = (np.abs(x) < 40) & (np.abs(y) < 80), (np.abs(y) < 8) & (x > 10) & (x < 66)
    across, up = np.clip(x / 40, -1, 1), np.clip(y / 8, -1, 1)
    cylinder = np.dstack([across, 0 * x, np.sqrt(1 - across**2)])
    truth = np.where(handle[..., None], np.dstack([0 * x, up, np.sqrt(1 - up**2)]), cylinder)
    return cylinder, np.where((body | handle)[..., None], truth, np.nan), body, handle


def observed(truth: np.ndarray) -> np.ndarray:
    """Return the normals (H, W, 3) that show highlights, NaN elsewhere."""
    return np.where(truth[..., 2:] > np.cos(np.pi / 4), truth, np.nan)


def test_a_handle_is_followed_before_the_body() -> None:
    x, y = pixels()
    cylinder, truth, body, handle = cylinder_with_handle()
    shown, mask = observed(truth), body | handle
    beside = handles_beside(mask, body)
    assert (beside == handle & ~body).all()
    result = with_handles(cylinder, beside, mask, shown, shown[None])
    before = body & handle & (x < 38)
    error = angles(result, truth)
    assert np.median(error[before]) < 3.0 < np.median(angles(cylinder, truth)[before])
    assert error[body & (np.abs(y) > 12)].max() < 0.1
    alone = with_handles(cylinder, beside, mask, np.where(beside[..., None], shown, np.nan), cylinder[None])
    assert angles(alone, cylinder)[body].max() < 0.1


@pytest.mark.parametrize("steepness", [0.2, 0.8])
def test_false_highlights_of_a_steep_body_do_not_carry_its_handle_away(steepness: float) -> None:
    x, y = pixels()
    cylinder, truth, body, handle = cylinder_with_handle()
    shown, mask = observed(truth), body | handle
    # A sheet that goes on the field of the handle, wherever that grows to.
    false = unit(np.dstack([0 * x, steepness * np.clip(y / 16, -1, 1), 1 + 0 * x]))
    candidates = np.stack([shown, np.where(mask[..., None], false, np.nan)])
    result = with_handles(cylinder, handles_beside(mask, body), mask, shown, candidates)
    assert np.median(angles(result, truth)[body & handle & (x < 38)]) < 6.0
    assert angles(result, cylinder)[body & (np.abs(y) > 28)].max() < 1.0


def test_a_piece_of_the_table_in_the_mask_is_no_handle_to_follow() -> None:
    x, y = pixels()
    cylinder, truth, body, handle = cylinder_with_handle()
    blob = (np.hypot(x + 40, y - 30) < 8) & ~body
    shown, mask = observed(truth), body | handle | blob
    # What another light path shows of the body goes on from the piece.
    false = unit(np.dstack([-0.3 + 0 * x, 0.2 + 0 * x, 1 + 0 * x]))
    candidates = np.stack([shown, np.where(mask[..., None], false, np.nan)])
    accepted = np.where((y < 20)[..., None], shown, np.nan)
    result = with_handles(cylinder, handles_beside(mask, body), mask, accepted, candidates)
    assert angles(result, cylinder)[body & ~handle & (x < 0)].max() < 1.0


def test_no_handle_covers_what_was_accepted_of_the_body() -> None:
    _, y = pixels()
    cylinder, truth, body, handle = cylinder_with_handle()
    mask = body | handle
    false = unit(np.dstack([0 * y, 0.5 * np.clip(y / 16, -1, 1), 1 + 0 * y]))
    accepted = np.where((handle & ~body)[..., None], observed(truth), observed(cylinder))
    candidates = np.stack([accepted, np.where(mask[..., None], false, np.nan)])
    result = with_handles(cylinder, handles_beside(mask, body), mask, accepted, candidates)
    is_known = body & np.isfinite(observed(cylinder)[..., 0])
    assert angles(result, cylinder)[is_known].max() < 1.0
