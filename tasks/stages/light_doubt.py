"""Doubt about known lights that contradict the candidate normals: warnings, and what they leave of the confidence."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.lighting.coverage import EXTRAPOLATED_ERROR_DEG
from glint.tasks.algorithms.sheets.light_evidence import OPPOSITE, LightEvidence
from glint.tasks.engine.stage_warning import StageWarning

OTHER_AXES_ERROR_DEG = 25.0
"""Mean error of simulated objects whose lights have another axis negated: 22 to 27 degrees (docs/evaluation.md)."""
HALF_VECTORS_ERROR_DEG = 13.0
"""Mean error of simulated objects whose file holds half vectors: 11 to 14 degrees on hemisphere, bird and fish."""
NO_SURFACE_ERROR_DEG = 15.0
"""Mean error of simulated objects whose lights are ten frames early: 10 to 24 degrees (docs/evaluation.md)."""

NEGATED_AXES = ("x negated", "y negated", OPPOSITE)
"""Axes under which the inside of a bowl looks like the outside of a body, and so may be proven wrong by right lights:
of a simulated coupe seen from 32 degrees above, the opposite ones fit 21 times as well."""
OF_BOWLS = ". Where the camera looks into a bowl, right lights look so too: record that from the side"
MIN_HOLLOW_TURN_DEG = 90.0
"""Turn from which normals may be those of a hollow, which counts as turned by half a turn."""

MIN_TELLING_LIGHTS = 200
"""Lights from which right ones show a surface: with right lights the ratio of simulated fish and birds is -0.9 to -0.2
nats with 60 lights, -0.5 to -0.3 with 100, -0.1 to 0.2 with 150, 0.2 to 0.6 with 250, 1.1 to 2.1 with 800; with lights
ten frames early it is -1.4 to -0.8 at any number."""


@dataclass(frozen=True, slots=True)
class LightDoubt:
    """share: probability that the lights are right; half_vector_sd: radians, what their turn may cost a normal."""

    share: float = 1.0
    half_vector_sd: float = 0.0
    warnings: Sequence[StageWarning] = ()


def doubt_lights(evidence: LightEvidence, lights: int) -> LightDoubt:
    """Return the doubt about known lights.

    lights: their number.

    Lights that seem turned belong to other frames, some by more than the mean, so no pixel is spared the whole angle.
    """
    if evidence.has_other_axes:
        message = (
            f"the given lights contradict the object: {evidence.axes}, they would fit {evidence.axes_ratio:.1f} times"
            " as well: correct the axes of the `.lp` file (x to the right, y up, z towards the camera), or the order of"
            " its rows, unless it is the file of another capture" + (OF_BOWLS if evidence.axes in NEGATED_AXES else "")
        )
        warning = StageWarning(message, "light", OTHER_AXES_ERROR_DEG)
        return LightDoubt(share=1.0 / (1.0 + evidence.axes_ratio), warnings=[warning])
    if evidence.has_half_vectors:
        message = (
            "the given lights contradict the object: they are half vectors, as which they would fit"
            f" {evidence.half_ratio:.1f} times as well: write the directions to the light into the `.lp` file"
        )
        warning = StageWarning(message, "light", HALF_VECTORS_ERROR_DEG)
        return LightDoubt(share=1.0 / (1.0 + evidence.half_ratio), warnings=[warning])
    if evidence.has_no_surface:
        # The probability that candidates of such a likelihood ratio are a surface.
        share = 1.0 / (1.0 + float(np.exp(-evidence.log_ratio)))
        return LightDoubt(share=share, warnings=[_no_surface(lights)])
    if evidence.is_turned:
        message = (
            f"the given lights contradict the object: its normals are turned by {evidence.turn_deg:.0f} degrees about"
            " the camera axis: compare the rows of the `.lp` file, and their order, with the frames, and its axes with"
            " the camera's" + (OF_BOWLS if abs(evidence.turn_deg) > MIN_HOLLOW_TURN_DEG else "")
        )
        cost = abs(evidence.turn_deg)
        return LightDoubt(
            half_vector_sd=float(np.radians(cost)), warnings=[StageWarning(message, "light", round(cost, 1))]
        )
    return LightDoubt()


def _no_surface(lights: int) -> StageWarning:
    """Return the warning of lights whose normals no surface has; few of them are not accused of being wrong."""
    rows = "compare the rows of the `.lp` file, and their order, with the frames"
    if lights < MIN_TELLING_LIGHTS:
        message = (
            f"{lights} known lights are too few to show that they are right, so nothing is confident: take more"
            f" photographs, with the light in other places; if the surface is wrong, {rows}"
        )
        return StageWarning(message, "coverage", EXTRAPOLATED_ERROR_DEG)
    message = f"the given lights contradict the object: no surface has the normals that they give: {rows}"
    return StageWarning(message, "light", NO_SURFACE_ERROR_DEG)
