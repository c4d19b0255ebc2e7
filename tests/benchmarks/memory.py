"""Peak memory of `glint run`: of its largest process, and of all its processes together.

    python -m tests.benchmarks.memory [--frames 8000 32000] [--large]

--large: one object of 2,000 x 1,770 pixels and 500 frames (a simulated capture, enlarged four times) instead.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import av
import cv2
import numpy as np
import psutil

from glint.storage.catalogue.loading import Capture, Catalogue, Region, Sphere, load, write
from glint.storage.export.image_files import write_png
from glint.storage.footage.source import open_footage
from glint.tasks.simulation.simulate import CaptureOptions, simulate

ENLARGED = 4


def peak_memory(catalogue: Path, store: Path) -> tuple[float, float, float]:
    """Megabytes of the largest process and of all together at their peaks, and seconds, of a run in an own process."""
    command = [
        sys.executable,
        "-c",
        "from glint.flows.cli.main import main; main()",
        "run",
        str(catalogue),
        "--store",
        str(store),
    ]
    started = time.monotonic()
    process = psutil.Process(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).pid)
    largest = together = 0.0
    while process.is_running() and process.status() != psutil.STATUS_ZOMBIE:
        sizes = []
        for each in [process, *process.children(recursive=True)]:
            try:
                memory = each.memory_full_info()
                sizes.append((memory.rss / 1e6, memory.pss / 1e6))
            except psutil.Error:
                continue
        largest = max([largest, *(rss for rss, _ in sizes)])
        together = max(together, sum(pss for _, pss in sizes))
        time.sleep(0.5)
    if process.wait() != 0:
        raise SystemExit(f"glint run {catalogue} failed")
    return largest, together, time.monotonic() - started


def enlarged(catalogue: Path, out: Path) -> Path:
    """The catalogue's capture with frames and mask four times as large in both axes."""
    small = load(catalogue).objects[0].captures[0]
    assert small.region is not None and small.mask is not None
    out.mkdir()

    def larger(picture: np.ndarray) -> np.ndarray:
        return cv2.resize(picture, None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_LINEAR)

    def frames() -> Iterator[np.ndarray]:
        with open_footage(small.frames) as footage:
            yield from map(larger, footage.frames())

    with av.open(str(out / "video.mp4"), "w") as container:
        stream = None
        for picture in frames():
            if stream is None:
                stream = container.add_stream("libx264", rate=25, options={"crf": "18", "preset": "ultrafast"})
                stream.height, stream.width = picture.shape
                stream.pix_fmt = "yuv420p"
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="gray").reformat(format="yuv420p")))
        assert stream is not None
        container.mux(stream.encode())
    mask = cv2.imread(small.mask, cv2.IMREAD_GRAYSCALE)
    write_png(out / "mask.png", larger(mask) > 127)
    half = (ENLARGED - 1) / 2
    ball = small.spheres[0]
    large = Capture(
        id="front",
        frames=str(out / "video.mp4"),
        spheres=(Sphere(x=ball.x * ENLARGED + half, y=ball.y * ENLARGED + half, radius=ball.radius * ENLARGED),),
        region=Region(**{name: value * ENLARGED for name, value in small.region.model_dump().items()}),
        mask=str(out / "mask.png"),
    )
    entry = {"id": "large", "captures": [large.model_dump(mode="json", exclude_defaults=True)]}
    write(Catalogue.model_validate({"schema": 1, "name": "large", "objects": [entry]}), out / "catalogue.yaml")
    return out / "catalogue.yaml"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, nargs="+", default=[8000, 32000])
    parser.add_argument("--large", action="store_true")
    arguments = parser.parse_args()
    for count in [500] if arguments.large else arguments.frames:
        with tempfile.TemporaryDirectory() as folder:
            options = CaptureOptions(frames=count, scale=2.0 if arguments.large else 1.0)
            catalogue = simulate("hemisphere", Path(folder) / "captures", options).catalogue
            if arguments.large:
                catalogue = enlarged(catalogue, Path(folder) / "large")
            region = load(catalogue).objects[0].captures[0].region
            assert region is not None
            largest, together, seconds = peak_memory(catalogue, Path(folder) / "store")
            print(
                f"{count} frames of {region.width} x {region.height}: largest process {largest:.0f} MB,"
                f" all together {together:.0f} MB, {seconds:.0f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
