"""The perturbations of the robustness matrix, by name."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from glint.tasks.engine.stage_warning import Cause
from glint.tasks.robustness import input_changes as inputs
from glint.tasks.robustness import video_changes as video
from glint.tasks.robustness.perturbation import CaptureInputs, Perturbation, VideoChange

UNPERTURBED = "as-it-is"

QUICK = (UNPERTURBED, "sphere-10-larger", "mask-leaking", "lights-y-down", "blur-2", "camera-near")
"""One perturbation of every kind, for tests."""


def _video(change: VideoChange, *causes: Cause) -> Perturbation:
    def changed(capture: CaptureInputs) -> CaptureInputs | None:
        is_unusable = change.sphere_order is not None and not capture.entry.spheres
        return None if is_unusable else replace(capture, video=change)

    return Perturbation(causes, changed)


def _lights(change: inputs.LightsChange, *causes: Cause) -> Perturbation:
    return Perturbation(causes or ("light",), inputs.known_lights(change))


PERTURBATIONS: Mapping[str, Perturbation] = MappingProxyType(
    {
        UNPERTURBED: Perturbation(()),
        "sphere-found": Perturbation(("sphere",), inputs.without_spheres),
        "sphere-2-larger": Perturbation(("sphere",), inputs.sphere_radius(1.02)),
        "sphere-5-larger": Perturbation(("sphere",), inputs.sphere_radius(1.05)),
        "sphere-10-larger": Perturbation(("sphere",), inputs.sphere_radius(1.10)),
        "sphere-2-smaller": Perturbation(("sphere",), inputs.sphere_radius(0.98)),
        "sphere-5-smaller": Perturbation(("sphere",), inputs.sphere_radius(0.95)),
        "sphere-10-smaller": Perturbation(("sphere",), inputs.sphere_radius(0.90)),
        "sphere-shifted-2": Perturbation(("sphere",), inputs.sphere_centre(0.02)),
        "sphere-shifted-5": Perturbation(("sphere",), inputs.sphere_centre(0.05)),
        "sphere-shifted-10": Perturbation(("sphere",), inputs.sphere_centre(0.10)),
        "mask-estimated": Perturbation(("mask",), inputs.without_mask),
        "mask-dilated-3": Perturbation(("mask",), inputs.mask_grown(3)),
        "mask-dilated-8": Perturbation(("mask",), inputs.mask_grown(8)),
        "mask-eroded-3": Perturbation(("mask",), inputs.mask_grown(-3)),
        "mask-eroded-8": Perturbation(("mask",), inputs.mask_grown(-8)),
        "mask-shifted-3": Perturbation(("mask",), inputs.mask_shifted(3)),
        "mask-shifted-8": Perturbation(("mask",), inputs.mask_shifted(8)),
        "mask-leaking": Perturbation(("mask",), inputs.mask_leaking),
        "light-at-10-widths": Perturbation(("light",), options={"light_distance": 10.0}),
        "light-at-2.5-widths": Perturbation(("light",), options={"light_distance": 2.5}),
        "camera-near": Perturbation(("camera",), inputs.without_camera, options={"focal": 0.9}),
        "quarter-missing": Perturbation(("coverage",), options={"missing_quarter": True}),
        "highlights-exchanged-10": _video(VideoChange(sphere_order=inputs.exchanged_order(0.1)), "light", "sphere"),
        "highlights-exchanged-30": _video(VideoChange(sphere_order=inputs.exchanged_order(0.3)), "light", "sphere"),
        "highlights-exchanged-60": _video(VideoChange(sphere_order=inputs.exchanged_order(0.6)), "light", "sphere"),
        "lights-known": _lights(inputs.unchanged),
        "lights-shifted-by-1": _lights(inputs.shifted_rows(1)),
        "lights-shifted-by-10": _lights(inputs.shifted_rows(10)),
        "lights-10-missing-midway": _lights(inputs.shifted_rows(10, 0.5)),
        "lights-y-down": _lights(inputs.mirrored(1.0, -1.0, 1.0)),
        "lights-x-left": _lights(inputs.mirrored(-1.0, 1.0, 1.0)),
        "lights-z-away": _lights(inputs.mirrored(1.0, 1.0, -1.0)),
        "lights-turned-10-degrees": _lights(inputs.rotated_in_image(10.0)),
        "lights-turned-90-degrees": _lights(inputs.rotated_in_image(90.0)),
        "lights-exchanged-10": _lights(inputs.exchanged(0.1)),
        "lights-exchanged-30": _lights(inputs.exchanged(0.3)),
        "lights-exchanged-60": _lights(inputs.exchanged(0.6)),
        "frames-dropped-30": _video(VideoChange(order=video.dropped(0.3)), "video", "coverage"),
        "frames-doubled-30": _video(VideoChange(order=video.doubled(0.3)), "video"),
        "frames-out-of-order": _video(VideoChange(order=video.out_of_order), "video"),
        "exposure-0.6": _video(video.gain(0.6), "video", "highlights", "coverage"),
        "exposure-1.6": _video(video.gain(1.6), "video", "highlights"),
        "exposure-drifting-30": _video(video.gain(0.8, 0.3), "video", "highlights", "coverage"),
        "gamma-0.6": _video(video.gamma(0.6), "video", "highlights"),
        "gamma-1.6": _video(video.gamma(1.6), "video", "highlights"),
        "blur-1": _video(video.blur(1.0), "video", "highlights"),
        "blur-2": _video(video.blur(2.0), "video", "highlights"),
        "shake-1": _video(video.shake(1.0), "camera", "video"),
        "shake-3": _video(video.shake(3.0), "camera", "video"),
        "knock-3": _video(video.knock(3.0), "camera", "video"),
        "bit-rate-crf-35": _video(VideoChange(crf=35), "video", "highlights"),
        "bit-rate-crf-45": _video(VideoChange(crf=45), "video", "highlights"),
    }
)
"""Distances and sizes in pixels, of spheres in percent of the radius; see the functions that make them."""
