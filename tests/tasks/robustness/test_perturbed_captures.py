"""Perturbed captures as files."""

from pathlib import Path

import numpy as np

from glint.storage.catalogue.loading import Capture
from glint.storage.footage.source import open_footage
from glint.tasks.robustness.perturbation import VideoChange
from glint.tasks.robustness.perturbed_captures import _write_frames
from tests.storage.footage.videos import ramp, write_images


def test_images_of_an_earlier_run_are_not_read_again(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    write_images(tmp_path / "images", [ramp(index) for index in range(4)])
    entry = Capture(id="front", frames=str(tmp_path / "images"))
    folder = tmp_path / "perturbed"
    folder.mkdir()
    _write_frames(entry, VideoChange(), folder)
    address = _write_frames(entry, VideoChange(order=lambda count, generator: np.arange(2)), folder)
    with open_footage(address) as footage:
        assert len(footage.names) == 2
