"""Perturbed captures as files: what a perturbation changes is written, everything else stays where it is."""

from pathlib import Path

import numpy as np

from glint.storage.catalogue.loading import Capture
from glint.storage.export.image_files import write_png
from glint.storage.footage.luma import eight_bits
from glint.storage.footage.source import open_footage
from glint.storage.footage.writer import write_video
from glint.storage.inputs.lp_file import write_lights
from glint.storage.inputs.masks_and_truth import read_mask, read_truth
from glint.tasks.engine.parameters import SurveyParameters
from glint.tasks.robustness.input_changes import SEED
from glint.tasks.robustness.perturbation import CaptureInputs, Perturbation, VideoChange
from glint.tasks.robustness.video_changes import changed_frames
from glint.tasks.stages.frame_parts import around

FRAME_RATE = 25
"""Frames per second of perturbed videos."""


def load_inputs(entry: Capture) -> CaptureInputs:
    """Load the inputs of a capture with ground truth; where a region is not given, it is that of the given mask.

    Raises:
        InputError: mask or truth cannot be read.
    """
    assert entry.truth is not None
    lights = read_truth(entry.truth).lights
    # Marks belong to frames, and poses to the views of a model; neither survives a perturbation of the video.
    entry = entry.model_copy(update={"markup": None, "pose": None})
    address = entry.mask
    if address is None:
        return CaptureInputs(entry, None, lights)
    with open_footage(entry.frames) as footage:
        size = (footage.height, footage.width)
    if entry.region is None:
        region = around(read_mask(address, size), SurveyParameters().margin)
        entry = entry.model_copy(update={"region": region})
    return CaptureInputs(entry, read_mask(address, size, entry.region), lights)


def write_perturbed(entry: Capture, name: str, perturbation: Perturbation, folder: Path) -> Capture | None:
    """Write what a perturbation changes of a capture to a folder; return its entry with the perturbation's name as id.

    None: the perturbation does not apply to the capture.

    Raises:
        InputError: an input cannot be read; OSError: the folder cannot be written.
    """
    inputs = load_inputs(entry)
    perturbed = inputs if perturbation.change is None else perturbation.change(inputs)
    if perturbed is None:
        return None
    changed: dict[str, str] = {}
    folder.mkdir(parents=True, exist_ok=True)
    names: tuple[str, ...] = ()
    if perturbed.video is not None:
        changed["frames"] = _write_frames(entry, perturbed.video, folder)
    if perturbed.mask is not None and perturbed.mask is not inputs.mask:
        changed["mask"] = str(folder / "mask.png")
        write_png(folder / "mask.png", perturbed.mask)
    if perturbed.lights is not None and perturbed.lights is not inputs.lights:
        changed["lights"] = str(folder / "lights.lp")
        with open_footage(entry.frames) as footage:
            names = footage.names
        write_lights(
            folder / "lights.lp", perturbed.lights, names or [f"{row:06d}" for row in range(len(perturbed.lights))]
        )
    return perturbed.entry.model_copy(update={"id": name, **changed})


def _write_frames(entry: Capture, change: VideoChange, folder: Path) -> str:
    """Write the changed frames of a capture: a video as a video, images as images; return their address."""
    with open_footage(entry.frames) as footage:
        frames = [eight_bits(frame) for frame in footage.frames()]
        pictures = changed_frames(frames, change, entry.spheres, np.random.default_rng(SEED))
        if not footage.names:
            write_video(folder / "video.mp4", pictures, footage.width, footage.height, FRAME_RATE, change.crf)
            return str(folder / "video.mp4")
        for earlier in folder.glob("frame_*.png"):
            earlier.unlink()
        for number, picture in enumerate(pictures):
            write_png(folder / f"frame_{number:06d}.png", picture)
    return str(folder / "frame_*.png")
