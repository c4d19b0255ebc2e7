"""Doubt of masks that are right, too large, too small, cut, ragged, or joined by a neck."""

import cv2
import numpy as np
import pytest
from scipy import ndimage

from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.mask_checks.mask_doubt import Objection, covered_spheres, doubt_of, mask_objections
from glint.tasks.algorithms.masks.contour_edges import signed_distance
from tests.tasks.algorithms.masks.glass_on_table import GlassScene, draw_glass


@pytest.fixture(scope="module")
def disc() -> GlassScene:
    return draw_glass(inner=0.0)


def objections_to(scene: GlassScene, mask: np.ndarray, estimated: bool = False, crop: int = 0) -> list[Objection]:
    """Objections to a mask of the frames without their first `crop` rows."""
    frames, mask = scene.frames[:, crop:], mask[crop:]
    edges = np.zeros(mask.shape, bool)
    edges[0] = True
    free = np.ones(mask.shape, bool)
    free[:, 195:] = False
    background = np.median(frames, axis=0)
    return mask_objections(mask, background, frames.max(axis=0), free=free, estimated=estimated, edges=edges)


def test_nothing_speaks_against_the_true_mask(disc: GlassScene) -> None:
    objections = objections_to(disc, disc.mask, estimated=True)
    assert objections == [] and not doubt_of(disc.mask, objections).any()


@pytest.mark.parametrize(("pixels", "kind"), [(3, "too large"), (-3, "too small")])
def test_a_mask_three_pixels_off_is_noticed(disc: GlassScene, pixels: int, kind: str) -> None:
    if pixels > 0:
        mask = ndimage.distance_transform_edt(~disc.mask) <= pixels
    else:
        mask = ndimage.distance_transform_edt(disc.mask) > -pixels
    (objection,) = objections_to(disc, mask)
    assert objection.kind == kind and abs(objection.offset + pixels) <= 1.0
    doubt = doubt_of(mask, [objection])
    assert doubt[mask].max() == pytest.approx(0.8) and not doubt[~mask].any()
    # The doubt falls from the contour to the centre as fast as the contour is off.
    assert doubt[90, 31 - pixels] > 0.1 and doubt[90, 90] < 1e-6


@pytest.mark.parametrize("turn", [0.0, 45.0])
@pytest.mark.parametrize("pixels", [-4, 4])
def test_the_offset_of_a_block_does_not_depend_on_its_turn(pixels: int, turn: float) -> None:
    size = 160
    corners = cv2.boxPoints(((2.0 * size, 2.0 * size), (320.0, 320.0), turn))
    fine = cv2.fillPoly(np.zeros((4 * size, 4 * size), np.float32), [np.int32(np.round(corners))], 1.0)
    cover = cv2.resize(fine, (size, size), interpolation=cv2.INTER_AREA)
    noise = np.random.default_rng(0).normal(0.0, 1.0, (2, size, size))
    levels = cv2.GaussianBlur(90.0 + 40.0 * cover, (0, 0), 0.8) + noise
    mask, nowhere = signed_distance(cover > 0.5) <= pixels, np.zeros((size, size), bool)
    (objection,) = mask_objections(mask, levels[0], levels[1] + 20.0, free=~nowhere, estimated=False, edges=nowhere)
    assert objection.offset == -pixels


@pytest.mark.parametrize(("pixels", "kinds"), [(0, []), (4, ["too large"])])
def test_the_inner_side_of_a_thin_wall_is_no_contour(pixels: int, kinds: list[str]) -> None:
    down, right = np.mgrid[:160, :160] - 80.0
    outer = 50.0 - np.hypot(down, right)
    wall = 20.0 * np.clip(outer + 0.5, 0.0, 1.0) + 60.0 * np.clip(outer - 4.5, 0.0, 1.0)
    noise = np.random.default_rng(0).normal(0.0, 1.0, (2, *wall.shape))
    levels = cv2.GaussianBlur(90.0 + wall, (0, 0), 0.8) + noise
    everywhere = np.ones(wall.shape, bool)
    objections = mask_objections(
        outer > -pixels, levels[0], levels[1] + 20.0, free=everywhere, estimated=False, edges=~everywhere
    )
    assert [objection.kind for objection in objections] == kinds


def drawn(mask: np.ndarray, cover: np.ndarray, blur: float = 0.8, estimated: bool = False) -> list[Objection]:
    """Objections to a mask in the middle of a picture whose levels rise by 40 where an object covers it."""
    noise = np.random.default_rng(0).normal(0.0, 1.0, (2, *mask.shape))
    levels = cv2.GaussianBlur(90.0 + 40.0 * cover, (0, 0), blur) + noise
    everywhere = np.ones(mask.shape, bool)
    return mask_objections(mask, levels[0], levels[1] + 20.0, free=everywhere, estimated=estimated, edges=~everywhere)


def round_object(radius: float) -> np.ndarray:
    """Return which share (160, 160) of each pixel a disc in the middle covers."""
    down, right = np.mgrid[:160, :160] - 80.0
    return np.clip(radius + 0.5 - np.hypot(down, right), 0.0, 1.0)


def test_a_contour_two_pixels_off_is_noticed_however_blurred_the_edge() -> None:
    (objection,) = drawn(round_object(52.0) > 0.5, round_object(50.0), blur=1.3)
    assert objection.kind == "too large" and objection.offset == -2.0


def test_a_much_stronger_edge_inside_counts_more_than_a_line_outside() -> None:
    line = round_object(55.0) - round_object(54.0)
    (objection,) = drawn(round_object(50.0) > 0.5, round_object(46.0) + 0.3 * line)
    assert objection.kind == "too large" and objection.offset == -4.0


@pytest.mark.parametrize("rows", [slice(0, 90), slice(90, 180)])
def test_highlights_go_on_beyond_a_mask_that_lacks_half_of_the_object(disc: GlassScene, rows: slice) -> None:
    half = disc.mask.copy()
    half[rows] = False
    (objection,) = objections_to(disc, half)
    assert objection.kind == "continued" and abs(objection.y - 90.0) < 12.0 and 0.1 < objection.share < 0.6


def test_highlights_go_on_beyond_a_mask_that_is_moved(disc: GlassScene) -> None:
    (objection,) = objections_to(disc, np.roll(disc.mask, 12, axis=1))
    assert objection.kind in ("continued", "too small")


def test_a_caustic_beside_the_object_does_not_continue_it(disc: GlassScene) -> None:
    beside = ~disc.mask & (ndimage.distance_transform_edt(~disc.mask) < 8.0)
    beside[90:], beside[:, 90:] = False, False
    stripes = np.where(beside, 45.0 + 45.0 * np.sin(np.arange(beside.shape[1])), 0.0)
    frames = disc.frames.astype(float)
    frames[7] += stripes
    frames = frames.clip(0.0, 255.0)
    objections = objections_to(GlassScene(frames.astype(np.uint8), disc.mask, disc.sphere), disc.mask)
    assert [objection.kind for objection in objections] == []


def test_a_mask_covers_no_chrome_sphere() -> None:
    mask, sphere = np.zeros((80, 120), bool), Sphere(90.0, 40.0, 20.0)
    mask[20:60, 20:74] = True
    assert covered_spheres(mask, [sphere]) == []
    mask[20:60, 20:120] = True
    (objection,) = covered_spheres(mask, [sphere])
    assert objection.kind == "sphere" and objection.share > 0.95 and abs(objection.x - 90.0) < 1.0
    doubt = doubt_of(mask, [objection])
    assert doubt[40, 90] == 1.0 and doubt[40, 25] < 0.2


def test_a_piece_without_highlights_is_doubtful_if_the_mask_is_estimated(disc: GlassScene) -> None:
    wide = disc.mask.copy()
    wide[75:105, 140:185] = True
    kinds = {objection.kind: objection for objection in objections_to(disc, wide, estimated=True)}
    assert kinds["unsupported"].x > 140 and abs(kinds["unsupported"].y - 90) < 20
    doubt = doubt_of(wide, [kinds["unsupported"]])
    assert doubt[90, 183] > 0.08 > 0.02 > doubt[90, 40] > 0.0
    assert objections_to(disc, disc.mask) == []


def test_an_object_that_the_frame_cuts_is_doubtful_there(disc: GlassScene) -> None:
    objections = objections_to(disc, disc.mask, crop=60)
    cut = next(objection for objection in objections if objection.kind == "cut")
    assert cut.y == 0 and cut.share > 0.1


def test_an_object_that_touches_the_edge_of_the_frame_is_not_cut_and_needs_no_highlights_there() -> None:
    mask = np.zeros((160, 160), bool)
    mask[60:160, 30:130] = True
    edges = np.zeros(mask.shape, bool)
    edges[0] = edges[-1] = True
    background = np.where(mask, 60.0, 120.0)
    rows, columns = np.indices(mask.shape)
    peak = np.where(
        mask & ((rows < 66) | (columns < 36) | (columns > 123)) & ((rows + columns) % 4 == 0), 250.0, background
    )
    everywhere = np.ones(mask.shape, bool)
    objections = mask_objections(mask, background, peak, free=everywhere, estimated=True, edges=edges)
    assert [objection.kind for objection in objections] == ["cut"]
    mask[150:, :77], mask[150:, 79:] = False, False
    objections = mask_objections(mask, background, peak, free=everywhere, estimated=False, edges=edges)
    assert "cut" not in {objection.kind for objection in objections}


def test_what_rises_by_a_few_levels_is_no_highlight() -> None:
    mask = round_object(50.0) > 0.5
    background = np.where(mask, 60.0, 120.0)
    rows, columns = np.indices(mask.shape)
    for rise, kinds in ((8.0, {"unsupported"}), (100.0, set())):
        peak = background + np.where(mask & ((rows + columns) % 4 == 0), rise, 0.0)
        everywhere = np.ones(mask.shape, bool)
        objections = mask_objections(mask, background, peak, free=everywhere, estimated=True, edges=~everywhere)
        assert {objection.kind for objection in objections} == kinds


@pytest.mark.parametrize(
    ("rise", "count", "share", "kinds"), [(2.0, 4, 1.0, []), (40.0, 96, 1.0, ["too small"]), (40.0, 48, 0.3, [])]
)
def test_highlights_beyond_a_contour_count_if_they_are_dense_along_much_of_it(
    rise: float, count: int, share: float, kinds: list[str]
) -> None:
    """An object that shows no highlights itself, with so many beside a share of its contour."""
    cover, noise = round_object(50.0), np.random.default_rng(0).normal(0.0, 1.0, (2, 160, 160))
    background, peak = 90.0 + rise * cover + noise[0], 110.0 + rise * cover + noise[1]
    turns, distance = 0.2 + 2.0 * np.pi * share * np.arange(count) / count, 53.5 + np.arange(count) % 2
    rows, columns = (np.rint(80.0 + distance * part(turns)).astype(int) for part in (np.sin, np.cos))
    peak[rows, columns] = 180.0
    everywhere = np.ones(cover.shape, bool)
    objections = mask_objections(cover > 0.5, background, peak, free=everywhere, estimated=False, edges=~everywhere)
    assert [objection.kind for objection in objections] == kinds
    assert all(objection.offset == 0.0 for objection in objections)


def test_pieces_that_nothing_joins_have_no_neck() -> None:
    mask = np.zeros((160, 160), bool)
    mask[30:80, 20:70], mask[30:80, 90:140] = True, True
    nothing, levels = np.zeros(mask.shape, bool), np.full(mask.shape, 60.0)
    for end, has_neck in ((80, False), (90, True)):
        mask[54:56, 70:end] = True
        objections = mask_objections(mask, levels, levels, free=~nothing, estimated=True, edges=nothing)
        assert ("neck" in {objection.kind for objection in objections}) == has_neck


def test_doubts_of_several_pieces_add_up() -> None:
    mask = round_object(50.0) > 0.5
    columns = np.indices(mask.shape)[1]
    left, right = mask & (columns < 36), mask & (columns > 124)
    objections = [Objection("neck", 0.1, 0.0, 0.0, 0.0, 0.5, left), Objection("ragged", 0.1, 0.0, 0.0, 0.0, 0.4, right)]
    doubt = doubt_of(mask, objections)
    assert doubt[left] == pytest.approx(0.5, abs=0.02) and doubt[right] == pytest.approx(0.4, abs=0.02)
    both = [Objection("neck", 0.1, 0.0, 0.0, 0.0, 0.5, left)] * 2
    assert doubt_of(mask, both)[left] == pytest.approx(0.75, abs=0.02)


def test_an_inverted_mask_and_one_of_the_whole_picture_are_told_from_an_object_at_the_edge(disc: GlassScene) -> None:
    for mask in (~disc.mask, np.ones_like(disc.mask)):
        objections = objections_to(disc, mask)
        assert "corners" in {objection.kind for objection in objections}
        assert "cut" not in {objection.kind for objection in objections}
        assert np.median(doubt_of(mask, objections)[mask]) > 0.05
    whole, none = np.ones_like(disc.mask), np.zeros_like(disc.mask)
    levels = disc.frames.max(axis=0)
    (objection,) = mask_objections(whole, levels, levels, free=whole, estimated=False, edges=none)
    assert objection.kind == "corners", "a region inside the frame has no edge of the picture"
    wide = disc.mask.copy()
    wide[:, : wide.shape[1] // 2] = True
    assert "corners" not in {objection.kind for objection in objections_to(disc, wide)}
    assert not objections_to(disc, disc.mask)


def test_necks_and_ragged_contours_are_doubtful_if_estimated(disc: GlassScene) -> None:
    neck = disc.mask.copy()
    neck[88:92, 30:190] = True
    neck[65:115, 168:194] = True
    kinds = {objection.kind for objection in objections_to(disc, neck, estimated=True)}
    assert "neck" in kinds
    ragged = disc.mask & ~(ndimage.distance_transform_edt(disc.mask) < 5)
    ragged |= disc.mask & (np.indices(disc.mask.shape).sum(axis=0) % 6 < 3)
    assert "ragged" in {objection.kind for objection in objections_to(disc, ragged, estimated=True)}
    assert not {"neck", "ragged"} & {objection.kind for objection in objections_to(disc, neck)}


def test_the_place_of_the_longest_piece_without_highlights_is_reported() -> None:
    """Upper left, where pixels of the contour touch at their corners alone, and not the shorter one below."""
    right, down = np.mgrid[-150:150, -150:150][::-1]
    mask, turn = np.hypot(right, down) < 100, np.degrees(np.arctan2(-down, right))
    shows_highlights = ~((turn > 115) & (turn < 155)) & ~((turn > -100) & (turn < -80))
    background = np.where(mask, 60, 120).astype(np.float32)
    is_lit = mask & (np.hypot(right, down) > 90) & shows_highlights & ((right + down) % 4 == 0)
    peak = np.where(is_lit, 250, background)
    nothing = np.zeros(mask.shape, bool)
    objections = mask_objections(mask, background, peak, free=~nothing, estimated=True, edges=nothing)
    (unsupported,) = (objection for objection in objections if objection.kind == "unsupported")
    assert np.hypot(unsupported.x - 80, unsupported.y - 80) < 10
