"""What contradicting lights leave of the confidence, and what is reported."""

import numpy as np
import pytest

from glint.tasks.algorithms.labelling.light_evidence import LightEvidence
from glint.tasks.stages.light_doubt import doubt_lights

NORMALS = np.array([[[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [np.nan] * 3]])


def test_right_lights_cost_nothing() -> None:
    doubt = doubt_lights(LightEvidence("y negated", 0.8, 1.0, 0.5, 1.5), NORMALS)
    assert (doubt.share, list(doubt.warnings)) == (1.0, [])
    assert not doubt.half_vector_sd.any()


@pytest.mark.parametrize(
    ("evidence", "text"),
    [
        (LightEvidence("y negated", 3.0, 0.0, 1.0, 1.0), "y negated, they would fit 3.0 times"),
        (LightEvidence("y negated", 0.5, 0.0, 1.0, -0.5), "no surface has the normals"),
    ],
)
def test_lights_that_are_wrong_everywhere_leave_nothing_confident(evidence: LightEvidence, text: str) -> None:
    doubt = doubt_lights(evidence, NORMALS)
    (warning,) = doubt.warnings
    assert text in warning.message and ".lp" in warning.message
    assert (warning.cause, doubt.share < 0.5) == ("light", True) and warning.cost_deg > 5.0


def test_a_turn_costs_by_the_tilt_of_a_normal() -> None:
    doubt = doubt_lights(LightEvidence("y negated", 0.5, -10.0, 0.5, 1.0), NORMALS)
    assert doubt.share == 1.0
    np.testing.assert_allclose(np.degrees(doubt.half_vector_sd), [[0.0, 6.0, 0.0]], atol=1e-4)
    assert "turned by -10 degrees" in doubt.warnings[0].message
    assert doubt.warnings[0].cost_deg == pytest.approx(3.0)
