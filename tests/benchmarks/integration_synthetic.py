"""Errors of the integration on synthetic surfaces with depth discontinuities, beside least squares and the publication.

    python -m tests.benchmarks.integration_synthetic [--published FOLDER] [--sizes 64 128] [--noise 0 1 3]
        [--searched PIXELS]

FOLDER holds the published code of Cao et al. 2022 (`bilateral_normal_integration_cpu.py`), which is run as it is on the
same scenes. Errors are mean absolute ones in pixels on the largest part without a step across it, after the median
offset (orthographic) or ratio (perspective). `steps`: largest relative error of a step's height. The last lines are the
geometric means over all scenes, the largest ratio to least squares, and the seconds of all scenes.
"""

import argparse
import contextlib
import importlib
import io
import sys
import time
import types
from collections.abc import Callable, Iterator

import numpy as np

from glint.tasks.algorithms.integration.bilateral import Method, integrate
from glint.tasks.algorithms.integration.search_limits import DEFAULT_LIMITS, SearchLimits
from tests.benchmarks.integration_scenes import FIELDS, Scene, pleats, traced, with_noise
from tests.benchmarks.integration_sheets import flap, risers, stairs

LEAST_ERROR_PX = 0.01
"""Added to errors before geometric means, so that an exact scene does not outweigh all."""

Solver = Callable[[Scene], np.ndarray]


def scenes(size: int) -> Iterator[tuple[str, Scene]]:
    """Yield all scenes of a size with their names; those under perspective end in `P`."""
    for step, bend, tilt in ((0.02, 0.0, 0.0), (0.06, 0.6, 0.3), (0.2, 0.6, 0.0), (0.4, -0.6, -0.5)):
        yield f"stairs {step:g}", stairs(size, step, bend=bend, tilt=tilt)
    for lift in (0.05, 0.2):
        yield f"flap {lift:g}", flap(size, lift)
    for width, slope in ((1, 5.0), (2, 3.0), (3, 6.0)):
        yield f"risers {width:d} {slope:g}", risers(size, width, slope)
    for depth in (0.15, 0.3):
        yield f"pleats {depth:g}", pleats(size, depth)
    for name, field in FIELDS.items():
        yield name, traced(field, size)
        yield f"{name} P", traced(field, size, perspective=True)


def ours(method: Method, limits: SearchLimits = DEFAULT_LIMITS) -> Solver:
    """Return the integration by a method, as a function of a scene."""
    return lambda scene: integrate(scene.normals, scene.mask, method=method, camera=scene.camera, limits=limits).depth


def published(folder: str) -> Solver:
    """Return the published code; its viewer and its progress bar are replaced where they are not installed."""
    for name, content in (("pyvista", {"PolyData": lambda *_: None}), ("tqdm.auto", {"tqdm": _Bar})):
        module = types.ModuleType(name)
        module.__dict__.update(content)
        sys.modules.setdefault(name.partition(".")[0], module)
        sys.modules.setdefault(name, module)
    sys.path.insert(0, folder)
    code = importlib.import_module("bilateral_normal_integration_cpu")

    def solve(scene: Scene) -> np.ndarray:
        normals = np.where(scene.mask[..., None], scene.normals, 0.0)
        with contextlib.redirect_stdout(io.StringIO()):
            depth = code.bilateral_normal_integration(normals, scene.mask, k=2, K=scene.camera)[0]
        return np.asarray(-depth if scene.camera is None else depth)

    return solve


class _Bar:
    """A progress bar that shows nothing."""

    def __init__(self, values: range) -> None:
        self.values = values

    def __iter__(self) -> Iterator[int]:
        return iter(self.values)

    def set_description(self, text: str) -> None:
        pass


def error(scene: Scene, depth: np.ndarray) -> float:
    """Mean absolute error in pixels."""
    truth, result = scene.height[scene.piece], depth[scene.piece].astype(float)
    if scene.camera is None:
        return float(np.abs(result - truth - np.median(result - truth)).mean())
    return float(np.abs(result * np.median(truth / result) - truth).mean())


def step_error(scene: Scene, depth: np.ndarray) -> float:
    """Largest relative error of a step's height; NaN without steps to measure."""
    ratios = [
        (depth[rows, column + 1] - depth[rows, column]).mean()
        / (scene.height[rows, column + 1] - scene.height[rows, column]).mean()
        for rows, column in scene.steps
    ]
    return float(max((abs(ratio - 1) for ratio in ratios), default=np.nan))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--published", metavar="FOLDER")
    parser.add_argument("--sizes", type=int, nargs="+", default=[64, 128])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 1.0, 3.0], help="degrees")
    parser.add_argument("--searched", type=int, metavar="PIXELS", help="also from coarse grids of at most so many")
    options = parser.parse_args()
    solvers = {"least-squares": ours("least-squares"), "bilateral": ours("bilateral")}
    if options.searched:
        solvers["from coarse"] = ours("bilateral", SearchLimits(max_searched=options.searched))
    if options.published:
        solvers["published"] = published(options.published)
    print(f"{'scene':22}" + "".join(f"{name:>15} {'steps':>5}" for name in solvers))
    errors, seconds = [], dict.fromkeys(solvers, 0.0)
    for size in options.sizes:
        for name, clean in scenes(size):
            for noise in options.noise:
                scene = with_noise(clean, noise) if noise else clean
                row, line = [], f"{name:10} {size:4d} {noise:4g}°"
                for solver, solve in solvers.items():
                    start = time.perf_counter()
                    depth = solve(scene)
                    seconds[solver] += time.perf_counter() - start
                    row.append(error(scene, depth))
                    line += f"{row[-1]:15.3f} {step_error(scene, depth):5.2f}"
                errors.append(row)
                print(line, flush=True)
    table = np.array(errors) + LEAST_ERROR_PX
    print(f"{'geometric mean':22}" + "".join(f"{value:15.3f}      " for value in np.exp(np.log(table).mean(axis=0))))
    print(f"{'worst to least squares':22}" + "".join(f"{v:15.2f}      " for v in (table / table[:, :1]).max(axis=0)))
    print(f"{'seconds':22}" + "".join(f"{value:15.1f}      " for value in seconds.values()))


if __name__ == "__main__":
    main()
