import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.perspective import VirtualCamera
from glint.tasks.algorithms.lighting.focal_length import estimate_focal_length
from glint.tasks.algorithms.lighting.spheres import Sphere, find_spheres, highlight_evidence, refine_sphere
from tests.tasks.algorithms.lighting.chrome_sphere import pooled, reflected_directions


def scene(spheres, *, shape=(260, 360), clutter=0, glass=None, seed=0):
    """Median and maximum of a scene with chrome spheres, a textured table, boxes and a round glass dome."""
    random = np.random.default_rng(seed)
    height, width = shape
    texture = cv2.GaussianBlur(random.normal(0, 60, shape), (0, 0), 4.0) + 70.0
    for _ in range(clutter):
        x, y, w, h = random.integers(0, width), random.integers(0, height), *random.integers(8, 60, 2)
        cv2.rectangle(texture, (int(x), int(y)), (int(x + w), int(y + h)), float(random.integers(20, 160)), -1)
    still, bright = texture.copy(), texture * 1.4
    if glass is not None:
        x, y, radius = glass
        cv2.circle(still, (x, y), radius, 50.0, -1)
        cv2.circle(still, (x - radius // 3, y - radius // 3), radius // 5, 150.0, -1)
        cv2.circle(bright, (x, y), radius, 250.0, -1)
    for sphere in spheres:
        mirrored, on_sphere = reflected_directions(sphere, shape, 4)
        share = pooled(on_sphere.astype(float), 4)
        room = 25.0 + 90.0 * ((np.abs(mirrored[..., 0] + 0.4) < 0.2) & (np.abs(mirrored[..., 1] - 0.4) < 0.25))
        swept = np.where(mirrored[..., 2] > np.cos(np.radians(80.0)), 255.0, room)
        still = still * (1 - share) + pooled(np.where(on_sphere, room, 0.0), 4)
        bright = bright * (1 - share) + pooled(np.where(on_sphere, swept, 0.0), 4)
    still, bright = (cv2.GaussianBlur(picture, (0, 0), 0.7) for picture in (still, bright))
    return np.clip(np.rint(still), 0, 255).astype(np.uint8), np.clip(np.rint(bright), 0, 255).astype(np.uint8)


def assert_near(found, truth, share=0.01):
    error = max(abs(found.x - truth.x), abs(found.y - truth.y), abs(found.radius - truth.radius))
    assert error <= share * truth.radius, (found, truth)


@pytest.mark.long
@pytest.mark.parametrize(
    ("sphere", "clutter"),
    [
        (Sphere(280.3, 140.8, 38.4), 0),
        (Sphere(60.7, 61.2, 21.0), 0),
        (Sphere(230.2, 128.6, 95.5), 0),
        (Sphere(280.3, 140.8, 38.4), 12),
    ],
)
def test_a_sphere_is_found_within_a_hundredth_of_its_radius(sphere, clutter):
    assert_near(find_spheres(*scene([sphere], clutter=clutter))[0], sphere, 0.015)


def test_a_glass_dome_is_not_taken_for_a_sphere():
    sphere = Sphere(300.4, 190.3, 33.2)
    found = find_spheres(*scene([sphere], glass=(130, 120, 80)))
    assert len(found) == 1
    assert_near(found[0], sphere, 0.015)


@pytest.mark.long
def test_glass_alone_is_no_sphere_and_the_remedy_is_given():
    with pytest.raises(UnusableCapture, match="spheres"):
        find_spheres(*scene([], glass=(130, 120, 80)))


@pytest.mark.long
def test_two_spheres_are_found():
    spheres = [Sphere(80.2, 90.6, 36.3), Sphere(270.7, 150.1, 40.5)]
    found = sorted(find_spheres(*scene(spheres)), key=lambda sphere: sphere.x)
    assert len(found) == 2
    for sphere, truth in zip(found, spheres, strict=True):
        assert_near(sphere, truth, 0.015)


@pytest.mark.long
def test_a_sphere_with_glare_is_found():
    sphere = Sphere(200.3, 130.8, 45.4)
    median, maximum = scene([sphere])
    for image in (median, maximum):
        cv2.ellipse(image, (235, 100), (30, 20), 40, 0, 360, 255, -1)
    assert_near(find_spheres(median, maximum)[0], sphere, 0.02)


@pytest.mark.parametrize("value", [0, 128, 255])
def test_flat_images_have_no_sphere(value):
    flat = np.full((120, 160), value, np.uint8)
    with pytest.raises(UnusableCapture):
        find_spheres(flat, flat)


def test_a_tiny_frame_has_no_sphere():
    with pytest.raises(UnusableCapture):
        find_spheres(np.zeros((9, 9), np.uint8), np.zeros((9, 9), np.uint8))


def test_images_of_unequal_shape_are_a_programming_error():
    with pytest.raises(ValueError, match="shapes"):
        find_spheres(np.zeros((9, 9)), np.zeros((9, 8)))


def test_refinement_reaches_below_a_pixel_from_a_rough_guess():
    sphere = Sphere(280.3, 140.8, 38.4)
    refined = refine_sphere(list(scene([sphere])), Sphere(281.0, 140.2, 39.1, 0.7))
    assert_near(refined, sphere)
    assert refined.score == 0.7


def test_highlights_up_to_the_contour_are_no_evidence():
    excess = np.zeros((100, 100), np.float32)
    cv2.circle(excess, (50, 50), 28, 200.0, -1)
    assert highlight_evidence(excess, 50.0, 50.0, 40.0) > 0.9
    assert highlight_evidence(excess, 50.0, 50.0, 28.0) == 0.0


def test_a_crop_moves_the_centre():
    assert Sphere(20.5, 30.0, 8.0).in_crop(10, 12) == Sphere(10.5, 18.0, 8.0)


def median_and_maximum(folder, pattern):
    paths = sorted(folder.glob(pattern))
    frames = np.stack([cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in paths])
    return np.median(frames, axis=0), frames.max(axis=0)


@pytest.mark.shared
@pytest.mark.slow
@pytest.mark.parametrize("probe", ["LightProbe-1", "LightProbe-2"])
def test_the_spheres_of_psbox(shared_data, probe):
    folder = shared_data / "real" / "psbox" / probe
    median, maximum = median_and_maximum(folder, "Image_*.JPG")
    x, y, radius = np.loadtxt(folder / "circle_data.txt")
    assert_near(find_spheres(median, maximum)[0], Sphere(x - 1.0, len(median) - y, radius))


@pytest.mark.shared
@pytest.mark.slow
def test_the_chrome_sphere_of_uw(shared_data):
    median, maximum = median_and_maximum(shared_data / "real" / "uw_chrome" / "chrome", "chrome.[0-9]*.png")
    assert_near(find_spheres(median, maximum)[0], Sphere(253.5, 148.0, 119.25))


@pytest.mark.long
def test_a_near_camera_finds_a_sphere_by_its_ellipse():
    """Warp the image of a centred sphere, as a virtual camera sees it, to a camera that does not look at the sphere."""
    camera = np.array([[330.0, 0, 180.0], [0, 330.0, 130.0], [0, 0, 1.0]])
    truth = Sphere(300.0, 170.0, 38.0)
    virtual = VirtualCamera.aimed_at(truth.x, truth.y, truth.radius, camera)
    homography = np.linalg.inv(camera @ virtual.rotation.T @ np.linalg.inv(virtual.matrix))
    # A larger virtual image, whose centre moves with its size.
    size, shift = 600, 300.0 - virtual.centre
    homography = np.array([[1.0, 0, shift], [0, 1.0, shift], [0, 0, 1.0]]) @ homography
    circular = scene([Sphere(300.0, 300.0, truth.radius)], shape=(size, size))
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    still, bright = (cv2.warpPerspective(image, homography, (360, 260), flags=flags) for image in circular)
    found = find_spheres(still, bright, camera=camera)[0]
    assert_near(found, truth, 0.02)
    frame_centre = (180.0, 130.0)
    assert estimate_focal_length(still, bright, truth, frame_centre, 360) == pytest.approx(330 / 360, rel=0.5)
    orthographic = scene([truth])
    assert estimate_focal_length(*orthographic, truth, frame_centre, 360) is None
