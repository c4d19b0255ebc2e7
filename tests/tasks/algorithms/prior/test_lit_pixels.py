import numpy as np

from glint.tasks.algorithms.prior.lit_pixels import LitPixels
from tests.tasks.algorithms.prior.swept_cones import INRADIUS, swept_cone, tilted


def test_single_pixels_without_a_highlight_are_not_dark() -> None:
    mask = np.ones((40, 40), bool)
    field = np.broadcast_to(tilted(10.0), (40, 40, 3))
    accepted = np.random.default_rng(0).random(mask.shape) < 0.85
    pixels = LitPixels(accepted, mask, INRADIUS, swept_cone())
    assert not pixels.dark(field).any()
    accepted[10:20, 10:20] = False
    dark = pixels.dark(field)
    assert dark[10:20, 10:20].all() and dark.sum() < 130
    steep = np.broadcast_to(tilted(60.0), (40, 40, 3))
    assert not pixels.dark(steep).any()
