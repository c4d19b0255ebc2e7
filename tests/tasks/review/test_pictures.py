"""Pictures of a capture's inputs."""

import tracemalloc
from pathlib import Path

import numpy as np

from glint.storage.catalogue.models import Capture
from glint.storage.export.image_files import encode_png
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.review.pictures import frame_image, thumbnail


def context_of(folder: Path, frame: np.ndarray) -> CaptureContext:
    """A capture that never ran, of a set of one image in a folder."""
    (folder / "frames").mkdir(parents=True)
    (folder / "frames" / "1.png").write_bytes(encode_png(frame))
    capture = Capture(id="front", frames=str(folder / "frames"))
    return CaptureContext(str(folder / "store"), "vase", capture, Parameters())


def test_whoever_changes_a_picture_changes_it_for_nobody_else(tmp_path: Path) -> None:
    context = context_of(tmp_path, np.full((4, 6), 7, np.uint8))
    frame_image(context, 0)[:] = 0
    assert (frame_image(context, 0) == 7).all()


def test_thumbnails_of_many_captures_keep_few_frames(tmp_path: Path) -> None:
    frame = np.full((1000, 1000), 7, np.uint8)
    contexts = [context_of(tmp_path / str(number), frame) for number in range(12)]
    tracemalloc.start()
    try:
        pictures = [thumbnail(context) for context in contexts]
        kept, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(set(pictures)) == 1 and kept < 5 * frame.nbytes
