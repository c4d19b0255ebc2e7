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


def test_darkness_is_informative_where_most_pixels_that_face_the_lights_are_accepted() -> None:
    mask = np.ones((40, 40), bool)
    field = np.array(np.broadcast_to(tilted(10.0), (40, 40, 3)))
    field[:20] = tilted(60.0)
    pixels, accepted = LitPixels(mask, mask, INRADIUS, swept_cone()), np.zeros_like(mask)
    accepted[:20] = True
    assert not pixels.is_informative(field, accepted), "none of them faces the lights"
    accepted[20:29] = True
    assert not pixels.is_informative(field, accepted)
    accepted[29:31] = True
    assert pixels.is_informative(field, accepted)


def test_of_every_other_pixel_the_inradius_is_half_as_many() -> None:
    mask = np.ones((40, 30), bool)
    mask[0] = False
    half = LitPixels(~mask, mask, INRADIUS, swept_cone()).subsampled(2)
    assert half.inradius == INRADIUS / 2 and half.mask.shape == (20, 15)
    assert np.array_equal(half.lit, ~half.mask) and half.lit[0].all() and half.mask[1:].all()


def test_nothing_outside_the_mask_is_dark() -> None:
    mask = np.zeros((40, 40), bool)
    mask[5:30, 5:30] = True
    field = np.broadcast_to(tilted(10.0), (40, 40, 3))
    dark = LitPixels(np.zeros_like(mask), mask, 100.0, swept_cone()).dark(field)
    assert dark[8:27, 8:27].all() and not dark[~mask].any()


def test_a_gap_between_highlights_is_dark_if_it_is_large_for_the_object() -> None:
    lit, field = np.ones((40, 40), bool), np.broadcast_to(tilted(10.0), (40, 40, 3))
    lit[10:20, 10:20] = False
    small, large = (LitPixels(lit, np.ones_like(lit), inradius, swept_cone()).dark(field) for inradius in (50.0, 500.0))
    assert small[10:20, 10:20].all() and not large.any()
