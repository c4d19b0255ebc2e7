"""What the review page shows of one capture, against what its stages have stored and against known answers."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glint.storage.edits.models import Changes
from glint.storage.errors import InputError
from glint.storage.locations.location import Location
from glint.tasks.algorithms.labelling.results import PROVENANCE
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.references import load_catalogue
from glint.tasks.questions.capture_questions import CaptureQuestions
from glint.tasks.questions.kept_proposals import propose_or_recall
from glint.tasks.review import questions as review_questions
from glint.tasks.review.capture_inputs import capture_inputs, check_changes, check_mask, mask_in_use, mask_picture
from glint.tasks.review.pictures import THUMBNAIL_SIZE, first_frame, frame_picture, level_picture, thumbnail
from glint.tasks.review.pixel_history import pixel_history
from glint.tasks.review.questions import prepare, questions
from glint.tasks.review.sphere_fit import fit_sphere
from glint.tasks.review.stored import has_object
from glint.tasks.stages.capture_geometry import load_geometry
from tests.pictures import decode_picture
from tests.storage.footage.videos import ramp, write_video
from tests.tasks.make_context import make_context, perform_all

pytestmark = pytest.mark.long


def context_in(store: str, simulated: object) -> CaptureContext:
    return CaptureContext.of(load_catalogue(str(simulated)), "hemisphere", "front", store)


@pytest.fixture(scope="module")
def context(tmp_path_factory: pytest.TempPathFactory, simulated: object, performed: Path) -> CaptureContext:
    """The simulated capture, all stages performed."""
    store = tmp_path_factory.mktemp("review") / "store"
    shutil.copytree(performed, store)
    return context_in(str(store), simulated)


def test_a_frame_is_that_of_the_video_where_it_is_used(context: CaptureContext) -> None:
    from glint.storage.footage.source import open_footage

    address = context.file("frames")
    assert address is not None
    with open_footage(address) as footage:
        wanted = next(iter(footage.frames(start=150)))
    shown, geometry = decode_picture(frame_picture(context, 150)), load_geometry(context)
    assert shown.shape == wanted.shape
    for crop in geometry.crops.values():
        assert np.array_equal(shown[crop.rows, crop.columns], wanted[crop.rows, crop.columns])
    with pytest.raises(InputError, match="no frame 300"):
        frame_picture(context, 300)


def test_levels_mask_and_thumbnail(context: CaptureContext) -> None:
    region = load_geometry(context).region
    for level in ("background", "peak"):
        stored = context.load("frames").read(level)
        assert np.array_equal(decode_picture(level_picture(context, level))[region.rows, region.columns], stored)
    mask = context.load("mask").read("mask")
    shown = decode_picture(mask_picture(context))
    assert np.array_equal(shown[region.rows, region.columns] > 0, mask) and shown.sum() == 255 * mask.sum()
    painted = np.zeros(shown.shape, bool)
    painted[3:9, 4:8] = True
    assert np.array_equal(decode_picture(mask_picture(context, painted)) > 0, painted)
    check_mask(painted.shape, first_frame(context).shape)
    with pytest.raises(InputError, match="must have the frame's"):
        check_mask(painted[1:].shape, first_frame(context).shape)
    assert max(decode_picture(thumbnail(context)).shape) == THUMBNAIL_SIZE


def test_inputs_are_given_used_and_seen(context: CaptureContext) -> None:
    inputs = capture_inputs(context)
    height, width = first_frame(context).shape
    assert inputs["frame_size"] == [width, height] and inputs["frames"] == 300
    lights = context.load("lights").read("lights")
    assert [light is not None for light in inputs["lights"]] == np.isfinite(lights[:, 0]).tolist()
    assert inputs["used"]["region"] == load_geometry(context).region.model_dump()
    assert len(inputs["used"]["spheres"]) == 1


def test_a_pixel_names_its_frames_and_candidates(context: CaptureContext) -> None:
    region, clusters = load_geometry(context).region, context.load("clusters")
    observations = clusters.read("observations")
    row, column = np.unravel_index(int(observations.argmax()), observations.shape)
    pixel = pixel_history(context, int(column) + region.x, int(row) + region.y)
    assert pixel["count"] == observations[row, column] == len(pixel["frames"]) > 0
    assert all(frame["level"] > pixel["threshold"] for frame in pixel["frames"])
    normals = clusters.read("normals")[:, row, column]
    assert len(pixel["candidates"]) == np.isfinite(normals[:, 0]).sum()
    assert pixel["candidates"][0]["normal"] == pytest.approx(normals[0].tolist(), abs=1e-3)
    assert pixel["normal"]["provenance"] == PROVENANCE[context.load("labels").read("provenance")[row, column]]
    with pytest.raises(InputError, match="outside the region"):
        pixel_history(context, region.x - 1, region.y)


@pytest.mark.parametrize(("shift", "corrects"), [(0.0, False), (0.05, True)])
def test_a_drawn_sphere_is_measured(context: CaptureContext, shift: float, corrects: bool) -> None:
    (given,) = context.capture.spheres or load_geometry(context).spheres
    fit = fit_sphere(context, given.x + shift * given.radius, given.y, given.radius)
    assert fit.is_clear and fit.is_corrected == corrects
    assert np.hypot(fit.x - given.x, fit.y - given.y) < 0.015 * given.radius
    assert fit.misfit_px == pytest.approx(shift * given.radius, abs=0.015 * given.radius)


def test_looking_at_a_capture_that_never_ran_stores_nothing(tmp_path: object, simulated: object) -> None:
    new = context_in(str(tmp_path), simulated)
    assert capture_inputs(new)["used"] is None
    assert decode_picture(mask_picture(new)).shape == first_frame(new).shape
    assert decode_picture(level_picture(new, "peak")).max() > decode_picture(level_picture(new, "background")).mean()
    assert thumbnail(new) and frame_picture(new, 0)
    for refused in (lambda: frame_picture(new, 1), lambda: pixel_history(new, 5, 5)):
        with pytest.raises(InputError, match="before the first run"):
            refused()
    assert not has_object(Location.parse(str(tmp_path)), "hemisphere")


@pytest.mark.usefixtures("smooth_labels")
def test_questions_are_prepared_and_kept_by_what_they_follow_from(
    context: CaptureContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepare(context)
    (session,) = (item for key, item in review_questions._sessions.items() if key[0] == context.store)
    monkeypatch.setattr(review_questions, "_sessions", {})
    first = questions(context)["questions"]
    assert session.before is not None and first
    # Another server finds them in the store, and asks the same of them.
    monkeypatch.setattr(CaptureQuestions, "propose", lambda *_: pytest.fail("proposed again"))
    monkeypatch.setattr(review_questions, "_sessions", {})
    assert questions(context)["questions"] == first
    held = review_questions.session_of(context)
    mark = session.proposals[()][0].answer(is_true=True)
    for keys, marks in ((held.keys | {"labels": "other"}, ()), (held.keys, (mark,))):
        with pytest.raises(pytest.fail.Exception, match="proposed again"):
            propose_or_recall(held.questions, keys, marks, review_questions.COUNT)
    posed = context.capture.model_validate(context.capture.model_dump(mode="json") | {"pose": {"turntable": 30.0}})
    with pytest.raises(pytest.fail.Exception, match="proposed again"):
        propose_or_recall(CaptureQuestions(replace(context, capture=posed)), held.keys, (), review_questions.COUNT)


def test_what_a_run_with_another_region_left_is_shown_where_it_was(
    tmp_path: Path, simulated: Path, performed: Path
) -> None:
    shutil.copytree(performed, tmp_path / "store")
    before = make_context(simulated, tmp_path / "store")
    shown = {level: level_picture(before, level) for level in ("background", "peak")}
    mask = mask_picture(before)
    y, x = (int(place) for place in np.argwhere(mask_in_use(before))[0])
    pixel = pixel_history(before, x, y)
    assert before.capture.region is not None
    region = before.capture.region.model_dump()
    smaller = {"x": region["x"] + 3, "width": region["width"] - 5}
    after = make_context(simulated, tmp_path / "store", region=region | smaller, mask=None)
    perform_all(after, "survey")
    assert mask_picture(after) == mask
    assert pixel_history(after, x, y) == pixel
    assert {level: level_picture(after, level) for level in shown} == shown


def test_spheres_drawn_where_lights_are_known_are_refused(context: CaptureContext) -> None:
    lit = replace(context, capture=context.capture.model_copy(update={"spheres": (), "lights": "/nowhere/a.lp"}))
    with pytest.raises(InputError, match="known lights"):
        check_changes(Changes.model_validate({"spheres": [{"x": 20.0, "y": 20.0, "radius": 5.0}]}), lit)
    check_changes(Changes(spheres=()), lit)


@pytest.mark.parametrize(
    "changes",
    [
        {"marks": [{"frame": 0, "x": 100_000.0, "y": 1.0, "kind": "true"}]},
        {"marks": [{"frame": 50_000_000, "x": 1.0, "y": 1.0, "kind": "true"}]},
        {"spheres": [{"x": 100_000.0, "y": 10.0, "radius": 5.0}]},
        {"region": {"x": 100_000, "y": 0, "width": 5, "height": 5}},
        {"camera": {"matrix": [[35, 0, 18], [0, 35, 12], [0, 0, 1]]}},
    ],
)
def test_what_a_person_draws_beyond_the_frames_is_refused(context: CaptureContext, changes: dict[str, object]) -> None:
    with pytest.raises(InputError, match=r"frame"):
        check_changes(Changes.model_validate(changes), context)
    check_changes(Changes.model_validate({"marks": [{"frame": 0, "x": 1.0, "y": 1.0, "kind": "true"}]}), context)


def test_a_sphere_is_not_fitted_under_a_camera_matrix_in_millimetres(simulated: Path, tmp_path: Path) -> None:
    camera = {"matrix": [[35, 0, 18], [0, 35, 12], [0, 0, 1]]}
    with pytest.raises(InputError, match="focal length of 35"):
        fit_sphere(make_context(simulated, tmp_path / "store", camera=camera), 92.4, 44.2, 22.0)


def test_a_video_of_another_size_than_at_the_last_run_is_named(context: CaptureContext, tmp_path: Path) -> None:
    write_video(tmp_path / "again.mp4", [ramp(index, 24, 40) for index in range(3)])
    capture = context.capture.model_copy(update={"frames": str(tmp_path / "again.mp4")})
    replaced = replace(context, capture=capture)
    width, height = load_geometry(context).frame_size
    for refused in (
        lambda: frame_picture(replaced, 3),
        lambda: level_picture(replaced, "peak"),
        lambda: mask_in_use(replaced),
    ):
        with pytest.raises(InputError, match=f"is 40 x 24 pixels, and was {width} x {height} at the last run"):
            refused()
    with pytest.raises(InputError, match="painted mask"):
        mask_in_use(replaced, np.ones((height, width), bool))
    assert decode_picture(frame_picture(replaced, 0)).shape == (24, 40)
    assert capture_inputs(replaced)["frame_size"] == [40, 24], "the page opens, and its capture can be run"
