"""Photographs of real objects with what truth there is, as captures: the shared data's folder `real`.

Truth is analytic where the shape is known (spheres, a bottle as a surface of revolution, both from their masks), and
photometric stereo by Lambert's law (Woodham 1980) on matte objects and on glossy ones without their highlights.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from scipy import ndimage

from glint.storage.catalogue.loading import Capture, Catalogue, Object, Sphere, write
from glint.storage.inputs.lp_file import write_lights
from glint.tasks.algorithms.geometry.vectors import half_vectors_of, unit
from glint.tasks.algorithms.lighting import spheres
from glint.tasks.algorithms.lighting.lights import find_lights
from tests.pictures import read_picture

Surface = Literal["matte", "glossy", "mirror"]
UW_SPHERE = spheres.Sphere(253.5, 148.0, 119.25)


@dataclass(frozen=True, slots=True)
class RealSet:
    """One object: photographs by a pattern, lights (T, 3) from elsewhere or a sphere of its own, mask (H, W) of the
    full frame or None to have it estimated, true normals (H, W, 3), NaN where unknown, or None."""

    name: str
    surface: Surface
    frames: str
    lights: np.ndarray | None
    sphere: spheres.Sphere | None
    mask: np.ndarray | None
    truth: np.ndarray | None


def real_sets(data: Path) -> dict[str, Callable[[], RealSet]]:
    """Every set under the shared data's folder, by name; made when called."""
    real = data / "real"
    return {
        "cat": lambda: _cat(real / "psbox"),
        "probe-1": lambda: _probe(real / "psbox" / "LightProbe-1", "probe-1"),
        "probe-2": lambda: _probe(real / "psbox" / "LightProbe-2", "probe-2"),
        "gray": lambda: _uw(real / "uw_chrome", "gray", "matte"),
        "owl": lambda: _uw(real / "uw_chrome", "owl", "glossy"),
        "chrome": lambda: _uw(real / "uw_chrome", "chrome", "mirror"),
        "bottle": lambda: _bottle(real / "bottle"),
        "glossy-sphere": lambda: _reference(real / "bottle", "0001/ref_spec_*.png", "0001/mask_ref_spec.png", "glossy"),
        "matte-sphere": lambda: _reference(real / "bottle", "0000/ref_diff_*.png", "0000/mask_ref_diff.png", "matte"),
        "gold-ring": lambda: _gold_ring(real / "gold_ring"),
    }


def write_catalogue(real: RealSet, folder: Path) -> Path:
    """Write mask, lights and a catalogue with one capture, `real.name`/front; return the catalogue's file."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = _paths(real.frames)
    mask = lights = None
    if real.mask is not None:
        mask = str(folder / "mask.png")
        cv2.imwrite(mask, np.where(real.mask, 255, 0).astype(np.uint8))
    if real.lights is not None:
        lights = str(folder / "lights.lp")
        write_lights(Path(lights), real.lights, [path.name for path in paths])
    sphere = () if real.sphere is None else (Sphere(x=real.sphere.x, y=real.sphere.y, radius=real.sphere.radius),)
    capture = Capture(id="front", frames=real.frames, spheres=sphere, lights=lights, mask=mask)
    catalogue = Catalogue.model_validate(
        {"schema": 1, "name": "real", "objects": (Object(id=real.name, captures=(capture,)),)}
    )
    write(catalogue, folder / "catalogue.yaml")
    return folder / "catalogue.yaml"


def sphere_normals(shape: tuple[int, int], sphere: spheres.Sphere) -> np.ndarray:
    """Normals (H, W, 3) of a sphere seen orthographically, NaN outside."""
    rows, columns = np.indices(shape)
    x, y = (columns - sphere.x) / sphere.radius, (sphere.y - rows) / sphere.radius
    inside = 1.0 - x**2 - y**2
    normals = np.stack([x, y, np.sqrt(np.maximum(inside, 0.0))], axis=-1)
    return np.where((inside > 0)[..., None], normals, np.nan)


def lambert_normals(frames: np.ndarray, lights: np.ndarray, *, brightest_left_out: int) -> np.ndarray:
    """Normals (H, W, 3) by Lambert's law from frames (T, H, W); attached shadows and the brightest are left out."""
    stack = frames.astype(float)
    order = stack.argsort(axis=0).argsort(axis=0)
    used = (stack > 0.15 * np.quantile(stack, 0.8, axis=0)) & (order < len(stack) - brightest_left_out)
    outer = lights[:, :, None] * lights[:, None, :]
    left = np.einsum("thw,tij->hwij", used, outer) + 1e-6 * np.eye(3)
    right = np.einsum("thw,thw,ti->hwi", used, stack, lights)
    normals = unit(np.linalg.solve(left, right[..., None])[..., 0])
    return np.where((used.sum(axis=0) >= 5)[..., None], normals, np.nan)


def _cat(folder: Path) -> RealSet:
    pattern = str(folder / "Objects" / "Image_*.png")
    frames = _photographs(pattern)
    lights = unit(np.loadtxt(folder / "light_directions.txt").T)
    mask = _largest(frames.max(axis=0) > 60)
    truth = lambert_normals(frames, lights, brightest_left_out=0)
    return RealSet("cat", "matte", pattern, lights, None, mask, _within(truth, mask))


def _probe(folder: Path, name: str) -> RealSet:
    pattern = str(folder / "Image_*.JPG")
    height = _photographs(pattern).shape[1:]
    x, y, radius = np.loadtxt(folder / "circle_data.txt")
    sphere = spheres.Sphere(x - 1, height[0] - y, radius)
    truth = sphere_normals((height[0], height[1]), sphere)
    return RealSet(name, "mirror", pattern, None, sphere, np.isfinite(truth[..., 0]), truth)


def _uw(folder: Path, name: str, surface: Surface) -> RealSet:
    pattern = str(folder / name / f"{name}.[0-9]*.png")
    mask = read_picture(folder / name / f"{name}.mask.png", cv2.IMREAD_GRAYSCALE) > 127
    shape = (mask.shape[0], mask.shape[1])
    if name == "chrome":
        return RealSet(name, surface, pattern, None, UW_SPHERE, mask, sphere_normals(shape, UW_SPHERE))
    lights = find_lights(_photographs(str(folder / "chrome" / "chrome.[0-9]*.png")), UW_SPHERE).lights
    if name == "gray":
        truth = sphere_normals(shape, _enclosing(mask))
    else:
        truth = lambert_normals(_photographs(pattern), lights, brightest_left_out=3)
    return RealSet(name, surface, pattern, lights, None, mask, _within(truth, mask))


def _bottle_lights(folder: Path) -> np.ndarray:
    """Lights (42, 3) by the mirror law, from the highlight on the glossy sphere."""
    frames = _photographs(str(folder / "ref_obj" / "0001" / "ref_spec_*.png"))
    mask = read_picture(folder / "ref_obj" / "0001" / "mask_ref_spec.png", cv2.IMREAD_GRAYSCALE) > 127
    normals = sphere_normals((mask.shape[0], mask.shape[1]), _enclosing(mask))
    lights = []
    for frame in frames.astype(float):
        # The highlight is far smaller than the shading around it.
        sharp = frame - ndimage.median_filter(frame, 25)
        sharp[~ndimage.binary_erosion(mask, iterations=4)] = 0
        near = sharp > 0.6 * sharp.max()
        half = unit(np.nansum(normals[near], axis=0))
        lights.append(2 * half[2] * half - (0, 0, 1))
    return np.array(lights)


def _bottle(folder: Path) -> RealSet:
    mask = read_picture(folder / "mask.png", cv2.IMREAD_GRAYSCALE) > 127
    truth = _body_of_revolution(mask)
    return RealSet("bottle", "glossy", str(folder / "img_*.png"), _bottle_lights(folder), None, mask, truth)


def _reference(folder: Path, frames: str, mask: str, surface: Surface) -> RealSet:
    pattern = str(folder / "ref_obj" / frames)
    image = read_picture(folder / "ref_obj" / mask, cv2.IMREAD_GRAYSCALE) > 127
    truth = sphere_normals((image.shape[0], image.shape[1]), _enclosing(image))
    name = f"{surface}-sphere"
    return RealSet(name, surface, pattern, _bottle_lights(folder), None, image, _within(truth, image))


def _gold_ring(folder: Path) -> RealSet:
    lines = (folder / "lights.lp").read_text().splitlines()[1:]
    lights = np.array([[float(value) for value in line.split()[1:]] for line in lines if line.strip()])
    return RealSet("gold-ring", "glossy", str(folder / "*.jpg"), lights, None, None, None)


def _body_of_revolution(mask: np.ndarray) -> np.ndarray:
    """Normals (H, W, 3) of an upright surface of revolution from its mask (H, W); NaN where its width jumps."""
    rows = np.flatnonzero(mask.sum(axis=1) > 0.5 * mask.sum(axis=1).max())
    left = np.array([np.flatnonzero(mask[row])[0] for row in rows], float)
    right = np.array([np.flatnonzero(mask[row])[-1] for row in rows], float)
    axis, radius = np.polyval(np.polyfit(rows, (left + right) / 2, 1), rows), (right - left + 1) / 2
    smooth = ndimage.gaussian_filter1d(radius, 3.0, mode="nearest")
    slope = np.gradient(smooth)
    normals = np.full((*mask.shape, 3), np.nan)
    columns = np.arange(mask.shape[1])
    for index, row in enumerate(rows):
        if abs(slope[index]) > 1.0 or index < 6 or index >= len(rows) - 6:
            continue
        x = (columns - axis[index]) / smooth[index]
        z = np.sqrt(np.where(np.abs(x) < 1, 1 - x**2, np.nan))
        normals[row] = unit(np.stack([x, np.full_like(x, slope[index]), z], axis=-1))
    return _within(normals, mask)


def _within(normals: np.ndarray, mask: np.ndarray) -> np.ndarray:
    return np.where(mask[..., None], normals, np.nan)


def _largest(mask: np.ndarray) -> np.ndarray:
    labels, _ = ndimage.label(mask)
    kept = labels == np.bincount(labels[mask]).argmax()
    return np.asarray(ndimage.binary_fill_holes(kept), bool)


def _enclosing(mask: np.ndarray) -> spheres.Sphere:
    """The sphere whose silhouette a round mask is, by the mask's extent."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    radius = (rows[-1] - rows[0] + columns[-1] - columns[0] + 2) / 4
    return spheres.Sphere((columns[0] + columns[-1]) / 2, (rows[0] + rows[-1]) / 2, radius)


def _paths(pattern: str) -> list[Path]:
    path = Path(pattern)
    return sorted(path.parent.glob(path.name), key=lambda item: (len(item.name), item.name))


def _photographs(pattern: str) -> np.ndarray:
    return np.stack([read_picture(path, cv2.IMREAD_GRAYSCALE) for path in _paths(pattern)])


__all__ = ["RealSet", "half_vectors_of", "lambert_normals", "real_sets", "sphere_normals", "write_catalogue"]
