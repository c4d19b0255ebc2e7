"""A capture's report as one HTML page that needs no other file: images, then figures as a table."""

import base64
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jinja2 import Environment, StrictUndefined, Template

from glint.storage.export.image_files import colour_codes, colour_normals, colour_values, encode_png
from glint.storage.export.report import DEPTH_DIRECTION, depth_range

PROVENANCE_PALETTE = np.array(
    [(255, 255, 255), (46, 125, 82), (216, 120, 24), (108, 92, 176), (168, 176, 186), (190, 60, 70), (60, 130, 190)],
    np.uint8,
)
"""Colours (uint8 RGB) of the provenance codes, in order."""

RELIT_CAPTION = "shaded as matte white under one distant light (N·L)"
COVERAGE_TEXTS = ("Coverage", "where on the hemisphere the light has been")
MAX_IMAGE_SIDE = 720
"""Pixels of the longer side of an image on the page."""


@dataclass(frozen=True, slots=True)
class ReportImage:
    """An image of the page: `data` is the content of an image file; `legend` pairs of CSS colour and text."""

    title: str
    caption: str
    data: bytes
    media_type: str = "image/png"
    legend: tuple[tuple[str, str], ...] = ()

    @property
    def address(self) -> str:
        """The image as a data URL."""
        return f"data:{self.media_type};base64,{base64.b64encode(self.data).decode()}"


def report_images(
    arrays: Mapping[str, Any], rendered: Iterable[tuple[str, bytes]], unit: str, names: dict[int, str]
) -> list[ReportImage]:
    """Return the images of the page, the normal map and the relit images first.

    arrays: see `capture_report`, and normals (H, W, 3); rendered: file names and PNG data of relit images and coverage;
    unit: of depth; names: of provenance codes.
    """
    images = [
        ReportImage(
            "Normals",
            "x right in red, y up in green, z towards the camera in blue",
            _png(colour_normals(arrays["normals"])),
        )
    ]
    for name, data in rendered:
        title, caption = COVERAGE_TEXTS if name == "coverage.png" else (_title(name), RELIT_CAPTION)
        images.append(ReportImage(title, caption, data))
    if "provenance" in arrays:
        present = np.unique(arrays["provenance"][arrays["mask"]])
        legend = tuple(
            (
                _css(PROVENANCE_PALETTE[min(int(code), len(PROVENANCE_PALETTE) - 1)]),
                names.get(int(code), f"code {code}"),
            )
            for code in present
        )
        codes = np.where(arrays["mask"], arrays["provenance"], 0)
        image = np.where(arrays["mask"][..., None], colour_codes(codes, PROVENANCE_PALETTE), np.uint8(255))
        images.append(
            ReportImage("Origin of the normals", "only those named observed were measured", _png(image), legend=legend)
        )
    if "confidence" in arrays:
        ends = ((_css(_end_colour(0)), "0"), (_css(_end_colour(1)), "1"))
        caption = "probability that the normal's error is below 5 degrees"
        images.append(ReportImage("Confidence", caption, _png(colour_values(arrays["confidence"], 0, 1)), legend=ends))
    limits = depth_range(arrays.get("depth"))
    if limits is not None:
        low, high = limits
        ends = ((_css(_end_colour(0)), f"{low:.4g} {unit}"), (_css(_end_colour(1)), f"{high:.4g} {unit}"))
        images.append(
            ReportImage(
                "Depth", f"{DEPTH_DIRECTION}, in {unit}", _png(colour_values(arrays["depth"], low, high)), legend=ends
            )
        )
    return images


def report_page(report: Mapping[str, Any], images: Sequence[ReportImage]) -> str:
    """Return the report as one HTML page; all texts are escaped."""
    return _template().render(report=report, images=images, figures=_figures(report))


@cache
def _template() -> Template:
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(Path(__file__).with_name("report.html").read_text(encoding="utf-8"))


def _figures(report: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Return the rows of the table: quantity, value with its unit, source."""
    counts, depth, region = report["counts"], report["depth"], report["region"]
    rows = [("Region", f"{region['width']} × {region['height']} pixels", "catalogue or detected")]
    if region.get("x") is not None:
        rows.append(
            ("Region's corner in the frame", f"x {region['x']}, y {region['y']} pixels", "catalogue or detected")
        )
    object_pixels = counts["pixels"]
    rows.append(("Object", f"{object_pixels:,} pixels", "mask"))
    rows.append(
        (
            "With a highlight, true or spurious (M > 0)",
            f"{counts['observed_pixels']:,} pixels, {_share(counts['observed_pixels'], object_pixels)}",
            "clusters",
        )
    )
    for name, number in counts.get("provenance", {}).items():
        rows.append((f"Normals {name}", f"{number:,} pixels, {_share(number, object_pixels)}", "labels"))
    if "frames" in counts:
        share = _share(counts["accepted_frames"], counts["frames"])
        rows.append(
            ("Frames with a light", f"{counts['accepted_frames']:,} of {counts['frames']:,}, {share}", "lights")
        )
    for reason, number in counts.get("rejected_frames", {}).items():
        rows.append((f"Frames rejected: {reason}", f"{number:,}", "lights"))
    if "median_confidence" in counts:
        rows.append(("Median confidence", f"{counts['median_confidence']:.2f} (probability)", "labels"))
    if depth["range"]:
        low, high = depth["range"]
        rows.append(("Depth", f"{low:.4g} to {high:.4g} {depth['unit']}, {depth['direction']}", "depth"))
    if depth["pixel_size_mm"]:
        rows.append(("Pixel", f"{depth['pixel_size_mm']:.4g} mm", "catalogue or sphere"))
    for field, change in (report["edits"] or {"changes": {}})["changes"].items():
        words = f"{change['author']}, {change['time'][:16].replace('T', ' ')} UTC"
        rows.append((f"Edited by a person: {field}", words, f"edit {change['revision']}"))
    seconds = [value for value in report["seconds"].values() if isinstance(value, int | float)]
    if seconds:
        rows.append(("Computing time", f"{sum(seconds):.1f} s in {len(seconds)} stages", "all stages"))
    return rows


def _share(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f} %" if whole else "none"


def _title(name: str) -> str:
    stem = Path(name).stem.removeprefix("relit_").replace("_", " ")
    if stem == "surface":
        return "Surface, rotated"
    return f"Relit from the {stem}" if stem else "Relit"


def _png(image: np.ndarray) -> bytes:
    """Encode an image for the page, reduced to MAX_IMAGE_SIDE if it is larger."""
    longest = max(image.shape[:2])
    if longest > MAX_IMAGE_SIDE:
        size = tuple(max(1, round(edge * MAX_IMAGE_SIDE / longest)) for edge in image.shape[1::-1])
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return encode_png(image)


def _end_colour(value: float) -> np.ndarray:
    """Return the colour (3,) of a value from 0 to 1 in `colour_values`."""
    return colour_values(np.array([[value]]), 0, 1)[0, 0]


def _css(colour: np.ndarray) -> str:
    return "#{:02x}{:02x}{:02x}".format(*(int(part) for part in colour))
