"""Decoding, cropping and storing the frames of a video, as a ratio to reading it with OpenCV and doing nothing else.

    python -m tests.benchmarks.frames_speed [VIDEO] [--frames N] [--repeat R] [--compressor lz4|zstd] [--one-pass]

VIDEO: a video of 408 x 244 pixels or more (default: the shared hemisphere capture, where it is there). A synthetic one
of N frames (default 8,000) is measured beside it. The crops are an object's region and one around a sphere. Both ways
take turns. Printed: codec and bit-rate; wall and processor seconds, and their ratios; the speed at which tiles of 64 x
64 pixels over all frames are read; and the peak memory of a process that ingests all frames, and only a quarter of
them. With --one-pass, no parts are decoded side by side.
"""

import argparse
import multiprocessing
import os
import resource
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter, process_time

import av
import cv2
import numpy as np

import glint.storage.footage.video
import glint.storage.frames.layout
from glint.storage.catalogue.loading import Region
from glint.storage.footage.source import open_footage
from glint.storage.frames.cache import FrameCache
from glint.storage.locations.location import Location

SHARED = Path(os.environ.get("GLINT_SHARED_DATA", Path(__file__).parents[3] / "shared" / "data"))
CROPS = {"object": Region(x=16, y=16, width=241, height=211), "sphere-0": Region(x=290, y=78, width=88, height=88)}


def synthetic(path: Path, count: int, height: int = 244, width: int = 408) -> Path:
    """Write a noisy H.264 video of a static scene under which a glint wanders."""
    random = np.random.default_rng(0)
    scene = cv2.GaussianBlur(random.uniform(20, 200, (height, width)).astype(np.float32), (0, 0), 6)
    noise = random.normal(0, 3, (16, height, width)).astype(np.float32)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30, options={"preset": "veryfast", "crf": "23"})
        stream.height, stream.width, stream.pix_fmt = height, width, "yuv420p"
        for index in range(count):
            frame = scene + noise[index * 7 % 16]
            cv2.circle(frame, (40 + index % 200, 60 + index // 50 % 120), 5, 255, -1)
            picture = np.full((height * 3 // 2, width), 128, np.uint8)
            picture[:height] = frame.clip(0, 255)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, "yuv420p")))
        container.mux(stream.encode())
    return path


def read(video: Path) -> int:
    """Read all frames with OpenCV; their number."""
    capture, frames = cv2.VideoCapture(str(video)), 0
    while capture.read()[0]:
        frames += 1
    return frames


def ingest(video: Path, store: Path) -> FrameCache:
    """Fill a cache with the crops of the video."""
    with open_footage(video) as footage:
        return FrameCache.ingest(footage, Location.parse(store), "digest", CROPS)


def seconds(work: Callable[[], object]) -> tuple[float, float]:
    """Wall and processor seconds."""
    wall, processor = perf_counter(), process_time()
    work()
    return perf_counter() - wall, process_time() - processor


def tiles(cache: FrameCache) -> float:
    """Megabytes per second at which the object is read in tiles of 64 x 64 pixels over all frames."""
    size, (height, width) = 0, (CROPS["object"].height, CROPS["object"].width)
    started = perf_counter()
    for top in range(0, height, 64):
        for left in range(0, width, 64):
            size += cache.read("object", rows=slice(top, top + 64), columns=slice(left, left + 64)).nbytes
    return size / 1e6 / (perf_counter() - started)


def peak(video: Path, store: Path) -> None:
    """Ingest and print this process's peak memory."""
    frames = ingest(video, store).frames
    print(f"  peak memory for {frames:,} frames: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024} MB")


def measure(video: Path, repeat: int, folder: Path) -> None:
    """Print what one video takes."""
    with av.open(str(video)) as container:
        stream = container.streams.video[0]
        rate = video.stat().st_size * 8 / float((stream.duration or 1) * (stream.time_base or 1)) / 1e6
        print(
            f"{stream.codec_context.name}, {stream.width} x {stream.height}, {rate:.1f} Mbit/s: {read(video):,} frames"
        )
    ratios = []
    for run in range(repeat):
        wall, processor = seconds(lambda: read(video))
        ours, our_processor = seconds(lambda: ingest(video, folder / f"{video.stem}-{run}"))  # noqa: B023
        ratios.append((ours / wall, our_processor / processor))
        print(f"  OpenCV {wall:.2f} s ({processor:.2f} s of processor), ingest {ours:.2f} s ({our_processor:.2f} s)")
    print("  ratio, median: wall {:.2f}, processor {:.2f}".format(*np.median(ratios, axis=0)))
    cache = FrameCache.open(Location.parse(folder / f"{video.stem}-0"), "digest")
    stored = sum(file.stat().st_size for file in Path(cache.location.path).rglob("*") if file.is_file())
    print(f"  tiles: {np.median([tiles(cache) for _ in range(repeat)]):.0f} MB/s; stored: {stored / 1e6:.0f} MB")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("video", type=Path, nargs="?", default=SHARED / "captures/hemisphere/front/video.mp4")
    parser.add_argument("--frames", type=int, default=8000)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--compressor", choices=("lz4", "zstd"), default=glint.storage.frames.layout.COMPRESSOR)
    parser.add_argument("--one-pass", action="store_true")
    arguments = parser.parse_args()
    if arguments.one_pass:
        glint.storage.footage.video.MAX_DECODERS = 1
    glint.storage.frames.layout.COMPRESSOR = arguments.compressor
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors; {arguments.compressor}")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        if arguments.video.is_file():
            measure(arguments.video, arguments.repeat, folder)
        whole = synthetic(folder / "whole.mp4", arguments.frames)
        measure(whole, arguments.repeat, folder)
        for video in (synthetic(folder / "part.mp4", arguments.frames // 4), whole):
            process = multiprocessing.get_context("spawn").Process(
                target=peak, args=(video, folder / f"p-{video.stem}")
            )
            process.start()
            process.join()


if __name__ == "__main__":
    main()
