"""Peak memory of every stage by the size of the region: the constants of `tasks/memory.py`.

    python -m tests.benchmarks.stage_memory [--factors 4 8 16] [--frames 80]

A drawn capture is enlarged; each stage is performed in a fresh process whose libraries are warm, and what that process
gains at its peak is divided by the region's pixels.
"""

import argparse
import multiprocessing
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import psutil

from glint.storage.catalogue.loading import Capture, Catalogue, Object, Region, Sphere, load, write
from glint.storage.export.image_files import write_png
from glint.storage.footage.source import open_footage
from glint.tasks.engine.references import CaptureReference
from glint.tasks.engine.stage import perform, stage_keys
from glint.tasks.pipeline import BY_NAME, STAGES
from glint.tasks.warm_up import warm_up
from tests.pictures import read_picture
from tests.scene import draw_scene
from tests.storage.footage.videos import write_video


def enlarged(small: Capture, out: Path, factor: int) -> Path:
    """Make a catalogue with the capture enlarged in both axes."""

    def larger(picture: np.ndarray) -> np.ndarray:
        return cv2.resize(picture, None, fx=factor, fy=factor, interpolation=cv2.INTER_LINEAR)

    def frames() -> Iterator[np.ndarray]:
        with open_footage(small.frames) as footage:
            for frame in footage.frames():
                yield larger(frame)

    assert small.region is not None and small.mask is not None
    out.mkdir(parents=True)
    video = write_video(out / "front.mp4", list(frames()), options={"crf": "18", "preset": "ultrafast"})
    write_png(out / "mask.png", larger(read_picture(Path(small.mask), cv2.IMREAD_GRAYSCALE)))
    capture = Capture(
        id="front",
        frames=str(video),
        spheres=tuple(Sphere(x=s.x * factor, y=s.y * factor, radius=s.radius * factor) for s in small.spheres),
        region=Region(**{name: edge * factor for name, edge in small.region.model_dump().items()}),
        mask=str(out / "mask.png"),
    )
    made = Catalogue.model_validate({"schema": 1, "name": "m", "objects": (Object(id="o", captures=(capture,)),)})
    write(made, out / "catalogue.yaml")
    return out / "catalogue.yaml"


def gained(reference: CaptureReference, stage: str) -> int:
    """Return the bytes that this process gains at its peak while it performs the stage; call it in a new process."""
    warm_up()
    work = reference.context()
    key = stage_keys(work, STAGES)[stage]
    before = psutil.Process().memory_info().rss
    Path("/proc/self/clear_refs").write_text("5")  # the peak counts from now on
    perform(work, BY_NAME[stage], key)
    (peak,) = re.findall(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return int(peak) * 1024 - before


def main() -> None:
    """Print a table: MB at the peak, and bytes per pixel of the region, by stage and size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--factors", type=int, nargs="+", default=[4, 8, 16])
    parser.add_argument("--frames", type=int, default=80)
    chosen = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as folder,
        multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool,
    ):
        small = load(draw_scene(Path(folder) / "small", frames=chosen.frames).catalogue).objects[0].captures[0]
        for factor in chosen.factors:
            catalogue = enlarged(small, Path(folder) / str(factor), factor)
            reference = CaptureReference(str(catalogue), "o", "front", str(Path(folder) / f"store-{factor}"), "run")
            assert small.region is not None
            pixels = small.region.width * small.region.height * factor**2
            for stage in BY_NAME:
                peak = pool.apply(gained, (reference, stage))
                print(
                    f"{pixels:>9,} pixels  {stage:10} {peak / 1e6:8.1f} MB  {peak / pixels:7.0f} bytes a pixel",
                    flush=True,
                )


if __name__ == "__main__":
    main()
