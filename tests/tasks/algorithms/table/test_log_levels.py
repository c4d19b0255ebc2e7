import numpy as np
import pytest

from glint.tasks.algorithms.table.log_levels import DARK_LEVEL, log_levels


def test_a_pattern_has_the_same_contrast_in_the_shadow_but_for_the_darkest_levels() -> None:
    light, shadow = (log_levels(np.array(levels, np.uint8)) for levels in ([200, 100], [100, 50]))
    assert light.dtype == np.float32
    assert -np.diff(light) == pytest.approx(-np.diff(shadow), abs=0.05)
    assert log_levels(np.zeros(1)) == pytest.approx(np.log(DARK_LEVEL))
