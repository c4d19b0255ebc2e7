"""Pictures of a capture's inputs."""

from pathlib import Path

import numpy as np

from glint.storage.catalogue.models import Capture
from glint.storage.export.image_files import encode_png
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.review.pictures import frame_image


def test_whoever_changes_a_picture_changes_it_for_nobody_else(tmp_path: Path) -> None:
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "1.png").write_bytes(encode_png(np.full((4, 6), 7, np.uint8)))
    capture = Capture(id="front", frames=str(tmp_path / "frames"))
    context = CaptureContext(str(tmp_path / "store"), "vase", capture, Parameters())
    frame_image(context, 0)[:] = 0
    assert (frame_image(context, 0) == 7).all()
