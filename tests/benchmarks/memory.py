"""Peak memory of `glint run`: of its largest process, and of all its processes together.

    python -m tests.benchmarks.memory [--frames 8000 32000] [--large h264|hevc10|photographs] [--keep FOLDER]

--large: one object of 2,000 x 1,770 pixels (a simulated capture, enlarged four times) in frames of 4K video, H.264 or
HEVC of 10 bits, or in photographs of 24 megapixels. The seconds of each stage are printed too. --keep: where to leave
the captures, which are not made again.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import psutil

from glint.storage.catalogue.loading import Capture, Catalogue, Region, Sphere, load
from glint.storage.catalogue.loading import write as write_catalogue
from glint.storage.export.image_files import write_png
from glint.storage.footage.source import open_footage
from glint.tasks.engine.references import CaptureReference
from glint.tasks.pipeline import NAMES
from glint.tasks.simulation.simulate import CaptureOptions, simulate

ENLARGED = 4
CODECS = {"h264": ("libx264", "yuv420p"), "hevc10": ("libx265", "yuv420p10le")}
SIZES = {"h264": (3840, 2160), "hevc10": (3840, 2160), "photographs": (6000, 4000)}
"""Width and height of a frame in pixels."""


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
        for member in [process, *process.children(recursive=True)]:
            try:
                memory = member.memory_full_info()
                sizes.append((memory.rss / 1e6, memory.pss / 1e6))
            except psutil.Error:
                continue
        largest = max([largest, *(rss for rss, _ in sizes)])
        together = max(together, sum(pss for _, pss in sizes))
        time.sleep(0.5)
    if process.wait() != 0:
        raise SystemExit(f"glint run {catalogue} failed")
    return largest, together, time.monotonic() - started


def enlarged(catalogue: Path, out: Path, kind: str) -> Path:
    """Make a catalogue of its capture, four times as large in both axes, in frames of the kind's size."""
    small = load(catalogue).objects[0].captures[0]
    assert small.region is not None and small.mask is not None
    out.mkdir()
    width, height = SIZES[kind]

    def larger(picture: Any) -> np.ndarray:
        whole = cv2.resize(picture, None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_LINEAR)[:height, :width]
        below, right = height - whole.shape[0], width - whole.shape[1]
        return cv2.copyMakeBorder(whole, 0, below, 0, right, cv2.BORDER_REPLICATE)

    def frames() -> Iterator[np.ndarray]:
        with open_footage(small.frames) as footage:
            yield from map(larger, footage.frames())

    if kind == "photographs":
        (out / "photographs").mkdir()
        for number, picture in enumerate(frames()):
            cv2.imwrite(str(out / "photographs" / f"{number:03}.jpg"), picture)
    else:
        write(out / "video.mp4", frames(), *CODECS[kind])
    write_png(out / "mask.png", larger(cv2.imread(small.mask, cv2.IMREAD_GRAYSCALE)) > 127)
    half = (ENLARGED - 1) / 2
    spheres = [
        Sphere(x=sphere.x * ENLARGED + half, y=sphere.y * ENLARGED + half, radius=sphere.radius * ENLARGED)
        for sphere in small.spheres
    ]
    large = Capture(
        id="front",
        frames=str(out / ("photographs" if kind == "photographs" else "video.mp4")),
        spheres=tuple(spheres),
        region=Region(**{name: value * ENLARGED for name, value in small.region.model_dump().items()}),
        mask=str(out / "mask.png"),
    )
    entry = {"id": "large", "captures": [large.model_dump(mode="json", exclude_defaults=True)]}
    write_catalogue(
        Catalogue.model_validate({"schema": 1, "name": "large", "objects": [entry]}), out / "catalogue.yaml"
    )
    return out / "catalogue.yaml"


def write(path: Path, frames: Iterator[np.ndarray], codec: str, pixels: str) -> None:
    """Write a video."""
    with av.open(str(path), "w") as container:
        stream: Any = None
        for picture in frames:
            if stream is None:
                stream = container.add_stream(codec, rate=25, options={"crf": "20", "preset": "ultrafast"})
                stream.height, stream.width = picture.shape
                stream.pix_fmt = pixels
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="gray").reformat(format=pixels)))
        assert stream is not None
        container.mux(stream.encode())


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, nargs="+", help="default: 8000 32000, or 500 with --large")
    parser.add_argument("--large", choices=SIZES)
    parser.add_argument("--keep", type=Path)
    arguments = parser.parse_args()
    for count in arguments.frames or ([500] if arguments.large else [8000, 32000]):
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary) if arguments.keep is None else arguments.keep / f"{arguments.large}-{count}"
            catalogue = folder / ("large" if arguments.large else "captures") / "catalogue.yaml"
            if not catalogue.exists():
                options = CaptureOptions(frames=count, scale=2.0 if arguments.large else 1.0)
                made = simulate("hemisphere", folder / "captures", options).catalogue
                catalogue = enlarged(made, folder / "large", arguments.large) if arguments.large else made
            region = load(catalogue).objects[0].captures[0].region
            assert region is not None
            store = Path(temporary) / "store"
            largest, together, seconds = peak_memory(catalogue, store)
            print(
                f"{count} frames of {region.width} x {region.height}: largest process {largest:.0f} MB,"
                f" all together {together:.0f} MB, {seconds:.0f} s ({stage_seconds(catalogue, store)})",
                flush=True,
            )


def stage_seconds(catalogue: Path, store: Path) -> str:
    """Return the seconds of each stage."""
    entry = load(catalogue).objects[0]
    context = CaptureReference(str(catalogue), entry.id, entry.captures[0].id, str(store), "memory").context()
    return ", ".join(f"{name} {context.load(name).record['seconds']:.1f}" for name in NAMES)


if __name__ == "__main__":
    main()
