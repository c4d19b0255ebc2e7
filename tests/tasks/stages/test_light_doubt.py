"""What contradicting lights leave of the confidence, and what is reported."""

import pytest

from glint.tasks.algorithms.sheets.light_evidence import LightEvidence
from glint.tasks.stages.light_doubt import MIN_TELLING_LIGHTS, LightDoubt, doubt_lights


def test_right_lights_cost_nothing() -> None:
    assert doubt_lights(LightEvidence("y negated", 0.8, 1.0, 0.5, 1.5), 900) == LightDoubt()
    assert doubt_lights(LightEvidence("y negated", 0.8, 6.0, 2.5, 1.5), 900) == LightDoubt(), "within its error"


@pytest.mark.parametrize(
    ("evidence", "text"),
    [
        (LightEvidence("y negated", 3.0, 0.0, 1.0, 1.0), "y negated, they would fit 3.0 times"),
        (
            LightEvidence("y negated", 0.5, 0.0, 1.0, 1.0, 1.8),
            "they are half vectors, as which they would fit 1.8 times",
        ),
        (LightEvidence("x negated", 3.0, 0.0, 1.0, 1.0), "or the order of its rows"),
        (LightEvidence("y negated", 0.5, 0.0, 1.0, -0.5), "no surface has the normals that they give: compare"),
    ],
)
def test_lights_that_are_wrong_everywhere_leave_nothing_confident(evidence: LightEvidence, text: str) -> None:
    doubt = doubt_lights(evidence, MIN_TELLING_LIGHTS)
    (warning,) = doubt.warnings
    assert text in warning.message and ".lp" in warning.message
    assert (warning.cause, doubt.share < 0.5) == ("light", True) and warning.cost_deg > 5.0


def test_a_turn_costs_its_angle() -> None:
    doubt = doubt_lights(LightEvidence("y negated", 0.5, -10.0, 0.5, 1.0), 900)
    assert doubt.share == 1.0 and doubt.half_vector_sd == pytest.approx(0.1745, abs=1e-3)
    assert "turned by -10 degrees" in doubt.warnings[0].message
    assert doubt.warnings[0].cost_deg == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("evidence", "is_said"),
    [
        (LightEvidence("x and y negated", 21.2, 0.0, 1.0, 1.0), True),
        (LightEvidence("x negated", 1.6, 0.0, 1.0, 1.0), True),
        (LightEvidence("x and y exchanged", 1.6, 0.0, 1.0, 1.0), False),
        (LightEvidence("y negated", 0.5, 143.0, 5.0, 1.0), True),
        (LightEvidence("y negated", 0.5, -10.0, 0.5, 1.0), False),
    ],
)
def test_right_lights_of_a_bowl_are_not_called_wrong_without_a_word_on_bowls(
    evidence: LightEvidence, is_said: bool
) -> None:
    (warning,) = doubt_lights(evidence, 900).warnings
    assert ("into a bowl, right lights look so too" in warning.message) == is_said


def test_few_lights_that_show_no_surface_are_not_called_wrong() -> None:
    evidence = LightEvidence("y negated", 0.5, 0.0, 1.0, -0.5)
    few, many = (doubt_lights(evidence, MIN_TELLING_LIGHTS - more) for more in (1, 0))
    assert few.share == many.share < 0.5
    assert few.warnings[0].message.startswith("199 known lights are too few to show that they are right")
    assert (few.warnings[0].cause, many.warnings[0].cause) == ("coverage", "light")
