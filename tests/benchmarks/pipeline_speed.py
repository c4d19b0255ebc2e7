"""From an opened video to exported depth, as a ratio to reading the same video with OpenCV and doing nothing else.

    python -m tests.benchmarks.pipeline_speed [CATALOGUE]

CATALOGUE: a catalogue whose first capture is a video (default: the hemisphere preset with its 8,000 frames, simulated
into a temporary folder). Server and cluster are up before the clock starts; the store is empty. Prints the codec, the
bit-rate, both times in seconds, their ratio, and the seconds of each stage.
"""

import argparse
import tempfile
from pathlib import Path
from time import perf_counter

import av
import cv2

from glint.flows.pipeline.run import PRELOADED
from glint.flows.runtime.dask_cluster import Cluster
from glint.flows.runtime.prefect_server import ensure_server
from tests.benchmarks.ratios import line

RATIO_BAR = 1.2
"""For the 8,000 frames of the hemisphere preset."""


def read_seconds(video: str) -> tuple[float, int]:
    """Time of cv2.VideoCapture.read over the whole file, and its frames."""
    capture, frames, started = cv2.VideoCapture(video), 0, perf_counter()
    while capture.read()[0]:
        frames += 1
    return perf_counter() - started, frames


def bit_rate(video: str) -> str:
    """Codec and bit-rate, as the file says."""
    with av.open(video) as container:
        stream = container.streams.video[0]
        rate = Path(video).stat().st_size * 8 / max(float(stream.frames) / float(stream.average_rate or 25), 1e-9)
        return f"{stream.codec_context.name}, {stream.width} x {stream.height}, {rate / 1e6:.1f} Mbit/s"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogue", type=Path, nargs="?")
    parser.add_argument("--only", help="OBJECT of the catalogue (default: its first)")
    parser.add_argument("--repeat", type=int, default=3)
    arguments = parser.parse_args()
    with (
        tempfile.TemporaryDirectory() as folder,
        ensure_server().connected(),
        Cluster(modules=PRELOADED) as cluster,
    ):
        from glint.flows.pipeline.catalogue import run_whole_catalogue
        from glint.flows.pipeline.context import activate
        from glint.storage.export.export import export
        from glint.storage.locations.location import Location
        from glint.tasks.engine.references import load_catalogue

        catalogue = arguments.catalogue
        if catalogue is None:
            from glint.tasks.simulation.simulate import CaptureOptions, simulate

            simulate("hemisphere", Path(folder) / "captures", CaptureOptions())
            catalogue = Path(folder) / "captures" / "catalogue.yaml"
        loaded = load_catalogue(catalogue)
        chosen = arguments.only or loaded.objects[0].id
        video = loaded.object(chosen).captures[0].frames
        print(bit_rate(video))
        for number in range(arguments.repeat):
            store = str(Path(folder) / f"store-{number}")
            reading, frames = read_seconds(video)
            started = perf_counter()
            with activate(cluster.client):
                result = run_whole_catalogue(str(catalogue), store, only=[chosen])
            assert not result.failed, result.failed
            export(Location.parse(store), chosen, Path(folder) / f"export-{number}")
            whole = perf_counter() - started
            stages = ", ".join(f"{record.stage} {record.seconds:.2f}" for record in result.captures[0].records)
            print(f"{frames} frames: read {reading:.2f} s, video to exported depth {whole:.2f} s ({stages})")
            print(line("video to depth / reading the video", whole / reading, RATIO_BAR), flush=True)


if __name__ == "__main__":
    main()
