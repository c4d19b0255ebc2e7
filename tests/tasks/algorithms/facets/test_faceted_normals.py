"""Faceted bodies that a view shows, and what it says of others."""

import numpy as np
import pytest

from glint.tasks.algorithms.facets.facet_evidence import facet_log_ratio
from glint.tasks.algorithms.facets.facet_view import FacetView
from glint.tasks.algorithms.facets.faceted_normals import FacetSearch
from glint.tasks.algorithms.facets.placements import Placement
from glint.tasks.algorithms.geometry.perspective import rotate_to_view, view_vectors
from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.sections.rounded_polygon import RoundedPolygon
from tests.tasks.algorithms.facets.bottle import render_bottle
from tests.tasks.algorithms.prisms.block import CAMERA, INVERSE_FOCAL, SHAPE, Block, shown

FRUSTUM = Block(lean=12.0)


def view_of(normals: np.ndarray, candidates: np.ndarray | None = None) -> FacetView:
    view = FacetView.of(shown(normals) if candidates is None else candidates, np.isfinite(normals[..., 0]), 0.0, 1)
    assert view is not None
    return view


def log_ratio(view: FacetView, tilt: float = 35.0, sides: int = 6, turn: float = 20.0) -> float:
    polygon = RoundedPolygon(sides, float(np.radians(turn)))
    return facet_log_ratio(view.body(Placement(0.0, 0.0, float(np.radians(tilt)), polygon)), view)


def test_a_view_speaks_for_its_body_alone() -> None:
    view = view_of(FRUSTUM.render()[0])
    true = log_ratio(view)
    assert true > 40.0
    others = [
        log_ratio(view, tilt=25.0),
        log_ratio(view, turn=50.0),
        log_ratio(view, sides=8),
        log_ratio(view, sides=4),
    ]
    assert max(others) < 0.5 * true


def test_a_face_that_would_have_flashed_speaks_against_a_body() -> None:
    normals = FRUSTUM.render()[0]
    candidates = shown(normals)
    before = log_ratio(view_of(normals, candidates))
    candidates[0][normals @ FRUSTUM.normals[2] > 0.99] = np.nan
    assert log_ratio(view_of(normals, candidates)) < before - 15.0


def test_flashes_beyond_its_crease_speak_against_a_face() -> None:
    normals = FRUSTUM.render()[0]
    candidates = shown(normals)
    before = log_ratio(view_of(normals, candidates))
    beyond = np.where((normals @ FRUSTUM.normals[3] > 0.99)[..., None], FRUSTUM.normals[2], np.nan)
    assert log_ratio(view_of(normals, np.concatenate([candidates, beyond[None]]))) < before - 5.0


def test_a_round_wall_has_no_creases() -> None:
    """A truncated cone with the lean of the frustum: at each meridian its normals turn as a crease's would."""
    turns = tuple(np.arange(0.0, 360.0, 4.0).tolist())
    view = view_of(Block(turns=turns, lean=12.0).render(rounding=3.0)[0])
    assert max(log_ratio(view, sides=sides, turn=turn) for sides in (8, 10, 12) for turn in (0.0, 10.0)) < 40.0


def test_a_body_that_leaves_the_silhouette_empty_is_unlikely() -> None:
    normals = FRUSTUM.render()[0]
    view = view_of(normals)
    narrow = Placement(0.0, 25.0, float(np.radians(35.0)), RoundedPolygon(6, float(np.radians(20.0))))
    assert facet_log_ratio(view.body(narrow), view) < 0.0


@pytest.mark.parametrize("block", [FRUSTUM, Block(slope=28.0, lean=14.0, turns=(10.0, 82.0, 154.0, 226.0, 298.0))])
def test_a_frustum_is_found_with_all_its_faces(block: Block) -> None:
    truth, depths, _ = block.render()
    mask = np.isfinite(depths)
    best, *_ = FacetSearch(shown(truth), mask, None).likeliest
    assert best.log_ratio > 30.0
    assert angles(best.normals, truth)[mask].mean() < 5.0
    assert (np.isfinite(best.normals[..., 0]) == mask).all()
    difference = (best.depths - depths)[mask]
    assert np.nanmedian(np.abs(difference - np.nanmedian(difference))) < 2.0


def test_a_bottle_with_a_neck_is_found() -> None:
    truth, depths = render_bottle()
    mask = np.isfinite(depths)
    best, *_ = FacetSearch(shown(truth), mask, None).likeliest
    assert best.log_ratio > 20.0
    assert angles(best.normals, truth)[mask].mean() < 9.0


def test_a_near_camera_sees_the_same_frustum() -> None:
    truth, depths, _ = Block(lean=12.0, inverse_focal=INVERSE_FOCAL).render()
    mask, view = np.isfinite(depths), view_vectors(CAMERA, SHAPE, 0.0, 0.0)
    relative = rotate_to_view(truth, view)
    best, *_ = FacetSearch(shown(relative), mask, CAMERA).likeliest
    assert angles(best.normals, relative)[mask].mean() < 5.0
    assert (best.faces[~mask] == -1).all()


def test_nothing_is_found_without_candidates_or_by_light_through_the_glass() -> None:
    truth = FRUSTUM.render()[0]
    mask = np.isfinite(truth[..., 0])
    assert FacetSearch(np.full((1, *SHAPE, 3), np.nan), mask, None).likeliest == []
    candidates = shown(truth)
    candidates[0] = np.where(np.isfinite(truth), unit(np.array([0.1, 0.15, 1.0])), np.nan)
    assert all(solid.log_ratio < 18.0 for solid in FacetSearch(candidates, mask, None).likeliest)
