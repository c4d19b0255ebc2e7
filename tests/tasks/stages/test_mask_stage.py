"""The mask of a bare video, given masks that are wrong, and what their doubt does to the confidence."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy import ndimage

from glint.tasks.engine.capture_context import CaptureContext
from tests.pictures import read_picture
from tests.tasks.make_context import make_context, perform_all


def true_mask(work: CaptureContext) -> tuple[np.ndarray, np.ndarray]:
    """The given mask, of the region's size and in the full frame."""
    pixels = read_picture(Path(str(work.capture.mask)), cv2.IMREAD_GRAYSCALE) > 0
    region = work.capture.region
    assert region is not None
    frame = np.zeros((region.y + region.height + 200, region.x + region.width + 400), bool)
    frame[region.rows, region.columns] = pixels
    return pixels, frame


def test_a_mask_that_covers_the_chrome_sphere_is_told_and_what_it_covers_is_not_confident(
    simulated: Path, tmp_path: Path
) -> None:
    given = make_context(simulated, tmp_path / "store")
    (sphere,) = given.capture.spheres
    _, frame = true_mask(given)
    perform_all(given, "survey")
    width, height = given.load("survey").record["frame_size"]
    rows, columns = np.mgrid[:height, :width]
    on_sphere = np.hypot(columns - sphere.x, rows - sphere.y) < sphere.radius
    cv2.imwrite(str(tmp_path / "mask.png"), np.where(frame[:height, :width] | on_sphere, 255, 0).astype(np.uint8))
    work = make_context(simulated, tmp_path / "store", mask=str(tmp_path / "mask.png"), region=None)
    (record,) = [record for record in perform_all(work, "mask") if record.stage == "mask"]
    assert any("of the circle of the chrome sphere" in warning.message for warning in record.warnings)
    place, doubt = work.load("mask").record["region"], work.load("mask").read("doubt")
    assert doubt[round(sphere.y) - place["y"], round(sphere.x) - place["x"]] == 1.0


@pytest.mark.parametrize("region", [True, False], ids=["region", "bare"])
def test_the_mask_of_a_video_without_one(simulated: Path, tmp_path: Path, region: bool) -> None:
    given = make_context(simulated, tmp_path / "store")
    kept = given.capture.region
    work = make_context(simulated, tmp_path / "store", mask=None, region=kept.model_dump() if kept and region else None)
    (record,) = [record for record in perform_all(work, "mask") if record.stage == "mask"]
    result = work.load("mask")
    place = result.record["region"]
    window = slice(place["y"], place["y"] + place["height"]), slice(place["x"], place["x"] + place["width"])
    truth = true_mask(given)[1][window]
    mask, doubt = result.read("mask"), result.read("doubt")
    assert result.record["estimated"]
    overlap = (mask & truth).sum() / (mask | truth).sum()
    warned = any(warning.cause == "mask" for warning in record.warnings)
    assert overlap > 0.85 and (overlap > 0.95 or warned)
    assert bool(doubt.any()) == warned and not doubt[~mask].any()


@pytest.mark.usefixtures("smooth_labels")
def test_a_given_mask_that_is_too_large_lowers_the_confidence_near_its_contour(
    simulated: Path, performed: Path, tmp_path: Path
) -> None:
    shutil.copytree(performed, tmp_path / "right")
    given = make_context(simulated, tmp_path / "right")
    right = next(record for record in perform_all(given, "labels") if record.stage == "mask")
    assert right.warnings == () and not given.load("mask").read("doubt").any()
    large = ndimage.distance_transform_edt(~true_mask(given)[0]) <= 3
    cv2.imwrite(str(tmp_path / "large.png"), large.astype(np.uint8) * 255)
    work = make_context(simulated, tmp_path / "wrong", mask=str(tmp_path / "large.png"))
    wrong = next(record for record in perform_all(work, "labels") if record.stage == "mask")
    (warning,) = wrong.warnings
    assert "too large by" in warning.message and "mask.png" in warning.message
    assert warning.cause == "mask" and warning.cost_deg > 0
    inside = true_mask(given)[0]
    rim = inside & (ndimage.distance_transform_edt(inside) <= 3)
    before, after = (context.load("labels").read("confidence") for context in (given, work))
    assert after[rim].mean() < 0.8 * before[rim].mean()
    # Highlights of the object's inside are in the mask, and as true as before.
    assert (after[inside & ~rim] >= 0.95).mean() > 0.05 and not (after[large & ~inside] >= 0.95).any()


def test_a_mask_of_two_objects_is_told_and_the_chrome_sphere_is_none(simulated: Path, tmp_path: Path) -> None:
    given = make_context(simulated, tmp_path / "store")
    pixels, _ = true_mask(given)
    halves = pixels.copy()
    halves[:, pixels.shape[1] // 2 - 8 : pixels.shape[1] // 2 + 8] = False
    cv2.imwrite(str(tmp_path / "halves.png"), halves.astype(np.uint8) * 255)
    work = make_context(simulated, tmp_path / "store", mask=str(tmp_path / "halves.png"))
    (record,) = [record for record in perform_all(work, "mask") if record.stage == "mask"]
    (warning,) = [warning for warning in record.warnings if "separate parts" in warning.message]
    left, right = halves[:, : pixels.shape[1] // 2].sum(), halves[:, pixels.shape[1] // 2 :].sum()
    assert f"2 separate parts of similar size, {max(left, right):,} and {min(left, right):,} pixels" in warning.message
    assert warning.cause == "mask" and "an object of its own" in warning.message
