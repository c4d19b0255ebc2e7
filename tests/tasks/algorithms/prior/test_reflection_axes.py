import numpy as np

from glint.tasks.algorithms.prior.reflection_axes import mirror_axes


def pixels() -> tuple[np.ndarray, np.ndarray]:
    columns, rows = np.meshgrid(np.arange(140) - 69.5, 99.5 - np.arange(200))
    return columns, rows


def test_a_tilted_axis_is_found_where_it_is() -> None:
    x, y = pixels()
    across = np.array([np.cos(0.3), np.sin(0.3)])
    side, up = x * across[0] + y * across[1] - 7.0, -x * across[1] + y * across[0]
    mask = (side / 30) ** 2 + (np.abs(up) / 75) ** 2 < 1
    axes = mirror_axes(mask)
    along_found = [abs(float(each.across @ across)) for each in axes]
    best = axes[int(np.argmax(along_found))]
    assert max(along_found) > np.cos(np.radians(1.0))
    assert abs(float(best.point @ across) - 7.0) < 1.0
