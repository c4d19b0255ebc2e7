import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.revolution.handles import handles_beside, with_handles


def pixels() -> tuple[np.ndarray, np.ndarray]:
    return tuple(np.meshgrid(np.arange(140) - 69.5, 99.5 - np.arange(200)))


def test_a_handle_is_followed_before_the_body() -> None:
    x, y = pixels()
    body, handle = (np.abs(x) < 40) & (np.abs(y) < 80), (np.abs(y) < 8) & (x > 10) & (x < 66)
    across, up = np.clip(x / 40, -1, 1), np.clip(y / 8, -1, 1)
    cylinder = np.dstack([across, 0 * x, np.sqrt(1 - across**2)])
    truth = np.where(handle[..., None], np.dstack([0 * x, up, np.sqrt(1 - up**2)]), cylinder)
    observed = np.where(((body | handle) & (truth[..., 2] > np.cos(np.pi / 4)))[..., None], truth, np.nan)
    beside = handles_beside(body | handle, body)
    assert (beside == handle & ~body).all()
    found = with_handles(cylinder, beside, body | handle, observed, observed[None])
    before = body & handle & (x < 38)
    error = angles(found, truth)
    assert np.median(error[before]) < 3.0 < np.median(angles(cylinder, truth)[before])
    assert error[body & (np.abs(y) > 12)].max() < 0.1
    alone = with_handles(cylinder, beside, body | handle, np.where(beside[..., None], observed, np.nan), cylinder[None])
    assert angles(alone, cylinder)[body].max() < 0.1
