"""Perturbations change an input by what their names state, and nothing else."""

import numpy as np
import pytest

from glint.storage.catalogue.loading import Capture, Region, Sphere
from glint.storage.catalogue.models import ID
from glint.tasks.robustness import input_changes, video_changes
from glint.tasks.robustness.perturbation import CaptureInputs, VideoChange
from glint.tasks.robustness.perturbations import PERTURBATIONS, QUICK, UNPERTURBED

SPHERE = Sphere(x=40.0, y=30.0, radius=10.0)
REGION = Region(x=0, y=0, width=40, height=40)
ENTRY = Capture(id="front", frames="front.mp4", spheres=(SPHERE,), region=REGION, mask="mask.png")


def _inputs() -> CaptureInputs:
    rows, columns = np.indices((40, 40))
    mask = (rows - 20) ** 2 + (columns - 20) ** 2 < 100
    lights = np.stack([np.linspace(-0.6, 0.6, 20), np.linspace(0, 0.3, 20), np.ones(20)], axis=1).astype(np.float32)
    lights[-1] = np.nan
    return CaptureInputs(ENTRY, mask, lights)


def _changed(name: str) -> CaptureInputs:
    change = PERTURBATIONS[name].change
    assert change is not None
    changed = change(_inputs())
    assert changed is not None
    return changed


def test_names_can_be_ids_of_captures() -> None:
    assert all(ID.fullmatch(name) for name in PERTURBATIONS)
    assert set(QUICK) < set(PERTURBATIONS) and not PERTURBATIONS[UNPERTURBED].causes
    assert all(item.causes for name, item in PERTURBATIONS.items() if name not in (UNPERTURBED, "lights-known"))


def test_spheres_are_moved_and_resized_by_a_share_of_the_radius() -> None:
    (larger,) = _changed("sphere-5-larger").entry.spheres
    assert (larger.x, larger.y, larger.radius) == (40.0, 30.0, 10.5)
    (moved,) = _changed("sphere-shifted-10").entry.spheres
    assert moved.radius == 10.0
    assert np.hypot(moved.x - 40.0, moved.y - 30.0) == pytest.approx(1.0)
    assert _changed("sphere-found").entry.spheres == ()


def test_masks_grow_shrink_move_and_leak() -> None:
    mask = _inputs().mask
    assert mask is not None
    dilated, eroded, moved, leaking = (
        _changed(name).mask for name in ("mask-dilated-3", "mask-eroded-3", "mask-shifted-8", "mask-leaking")
    )
    assert dilated is not None and eroded is not None and moved is not None and leaking is not None
    assert (eroded <= mask).all() and (mask <= dilated).all()
    assert 11 < np.sqrt(dilated.sum() / np.pi) < 14 and 6 < np.sqrt(eroded.sum() / np.pi) < 9
    centres = np.array([[values.mean() for values in np.nonzero(pixels)] for pixels in (mask, moved)])
    np.testing.assert_allclose(centres[1] - centres[0], [-5, 6], atol=0.6)
    assert (mask <= leaking).all() and leaking.sum() > 1.05 * mask.sum()
    assert _changed("mask-estimated").entry.mask is None


def test_known_lights_replace_the_spheres() -> None:
    known, down = _changed("lights-known"), _changed("lights-y-down")
    assert known.entry.spheres == () and known.lights is not None and down.lights is not None
    np.testing.assert_array_equal(known.lights[-1], [0, 0, -1])
    np.testing.assert_array_equal(down.lights, known.lights * [1, -1, 1])
    late, midway = _changed("lights-shifted-by-1").lights, _changed("lights-10-missing-midway").lights
    assert late is not None and midway is not None and len(midway) == 20
    np.testing.assert_array_equal(late[:19], known.lights[1:])
    np.testing.assert_array_equal(midway[:10], known.lights[:10])
    np.testing.assert_array_equal(midway[10], known.lights[19])


def test_a_share_of_the_rows_is_exchanged_among_themselves() -> None:
    order = input_changes.exchanged_order(0.3)(1000, np.random.default_rng(0))
    assert sorted(order) == list(range(1000))
    assert 0.28 < (order != np.arange(1000)).mean() <= 0.3


def test_without_an_input_its_perturbations_do_not_apply() -> None:
    bare = CaptureInputs(Capture(id="front", frames="front.mp4"), None, None)
    applied = []
    for name, perturbation in PERTURBATIONS.items():
        if perturbation.change is not None and perturbation.change(bare) is not None:
            applied.append(name)
    assert not [name for name in applied if name.startswith(("sphere", "mask", "light", "highlights", "camera"))]
    assert {"blur-2", "frames-doubled-30"} <= set(applied)


def _video(change: VideoChange, spheres: tuple[Sphere, ...] = ()) -> list[np.ndarray]:
    frames = [np.full((64, 64), number, np.uint8) for number in range(100)]
    return list(video_changes.changed_frames(frames, change, spheres, np.random.default_rng(0)))


def test_frames_are_dropped_doubled_and_shuffled() -> None:
    numbers = [[int(frame[0, 0]) for frame in _video(change)] for change in (
        VideoChange(order=video_changes.dropped(0.3)),
        VideoChange(order=video_changes.doubled(0.3)),
        VideoChange(order=video_changes.out_of_order),
    )]  # fmt: skip
    assert len(numbers[0]) == 70 and numbers[0] == sorted(set(numbers[0]))
    assert len(numbers[1]) == 130 and numbers[1] == sorted(numbers[1]) and set(numbers[1]) == set(range(100))
    assert sorted(numbers[2]) == list(range(100)) != numbers[2]
    assert max(abs(number - place) for place, number in enumerate(numbers[2])) < video_changes.SHUFFLED_FRAMES


def test_spheres_come_from_other_frames_and_the_object_does_not() -> None:
    frames = _video(VideoChange(sphere_order=input_changes.exchanged_order(1.0)), (SPHERE,))
    assert [int(frame[0, 0]) for frame in frames] == list(range(100))
    assert np.mean([frame[30, 40] != frame[0, 0] for frame in frames]) > 0.9


def test_light_and_motion_of_the_frames() -> None:
    frame = np.zeros((64, 64), np.uint8)
    frame[20:30, 20:30] = 100
    generator = np.random.default_rng(0)
    changes = (video_changes.gain(1.6), video_changes.gamma(0.5), video_changes.knock(5.0), video_changes.blur(2.0))
    brighter, flatter, moved, blurred = (
        change.pixels(frame, 0.75, generator) for change in changes if change.pixels is not None
    )
    assert (brighter.max(), flatter.max()) == (160, 160)
    assert moved[20:30, 20:30].sum() < frame.sum() and np.argmax(moved.sum(axis=0)) == 24
    assert blurred.max() < 100 and blurred.sum() == pytest.approx(frame.sum(), rel=0.05)
    knock = video_changes.knock(5.0).pixels
    assert knock is not None and (knock(frame, 0.25, generator) == frame).all()
