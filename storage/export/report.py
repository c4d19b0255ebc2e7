"""A capture's report: its figures as JSON, and a page for people that needs no other file.

Records of stages may say, each under its name: `parameters`, `seconds`, `counts`, `versions`, `inputs` (digests),
`warnings` (texts or {message, remedy}), `region` {x, y, width, height}, `frame_size` [width, height], `unit` and
`pixel_size` of depth, `coverage`, `reasons` (words of the lights' codes) and `provenance` (names of the labels' codes).
All are optional; the whole records are kept under `stages` too. What draws the page is imported when it is drawn, so
that the figures alone cost little.
"""

import base64
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from glint.storage.versions.stage_results import StageResult

if TYPE_CHECKING:
    from jinja2 import Template

DEPTH_DIRECTION = "towards the camera"
FRAME = "x right, y up, z towards the camera; unit normals; pixel (0, 0) is the centre of the top-left pixel, y down"
PALETTE = np.array(
    [(255, 255, 255), (46, 125, 82), (216, 120, 24), (108, 92, 176), (168, 176, 186), (190, 60, 70), (60, 130, 190)],
    np.uint8,
)
"""Colours of the provenance codes, in order."""

_RELIT = "shaded as matte white under one distant lamp (N·L)"
_COVERAGE = ("Coverage", "where on the hemisphere the lamp has been")
_WIDEST = 720


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture of the page: `data` is an image file's bytes; `legend` pairs of CSS colour and text."""

    title: str
    caption: str
    data: bytes
    media_type: str = "image/png"
    legend: tuple[tuple[str, str], ...] = ()

    @property
    def address(self) -> str:
        """The picture as a data address."""
        return f"data:{self.media_type};base64,{base64.b64encode(self.data).decode()}"


def code_names(codes: Any) -> dict[int, str]:
    """Names by code, from a record's sequence of names or mapping with codes as text."""
    if isinstance(codes, Mapping):
        return {int(code): str(name) for code, name in codes.items()}
    return {code: str(name) for code, name in enumerate(codes or ())}


def capture_report(
    object_id: str,
    capture: str,
    version: Mapping[str, Any],
    results: Mapping[str, StageResult],
    arrays: Mapping[str, Any],
) -> dict[str, Any]:
    """All figures of a capture as plain JSON. `arrays`: mask, observed, depth, reason, provenance as exported."""
    records = {stage: result.record for stage, result in results.items()}
    unit = _first(records, "unit") or "pixels"
    depth, mask = arrays.get("depth"), arrays["mask"]
    return {
        "object": object_id,
        "capture": capture,
        "version": version,
        "region": _first(records, "region") or {"x": None, "y": None, "width": mask.shape[1], "height": mask.shape[0]},
        "frame_size": _first(records, "frame_size"),
        "axes": FRAME,
        "depth": {
            "unit": unit,
            "direction": DEPTH_DIRECTION,
            "pixel_size_mm": _first(records, "pixel_size"),
            "range": _range(depth),
            "offset": "free for each connected component",
        },
        "counts": _counts(arrays, records) | _merged(records, "counts"),
        "coverage": _first(records, "coverage"),
        "seconds": {stage: record["seconds"] for stage, record in records.items() if record.get("seconds") is not None},
        "warnings": [warning for stage, record in records.items() for warning in _warnings(stage, record)],
        "parameters": {stage: record["parameters"] for stage, record in records.items() if "parameters" in record},
        "fingerprints": {stage: result.key for stage, result in results.items()},
        "inputs": _merged(records, "inputs"),
        "versions": _merged(records, "versions"),
        "stages": records,
    }


def report_pictures(
    arrays: Mapping[str, Any], drawn: Iterable[tuple[str, bytes]], unit: str, names: dict[int, str]
) -> list[Picture]:
    """What a person wants to see, the normal map and the relit pictures first."""
    from glint.storage.export.image_files import colour_codes, colour_normals, colour_values

    pictures = [
        Picture(
            "Normals",
            "x right in red, y up in green, z towards the camera in blue",
            _png(colour_normals(arrays["normals"])),
        )
    ]
    for name, data in drawn:
        title, caption = _COVERAGE if name == "coverage.png" else (_title(name), _RELIT)
        pictures.append(Picture(title, caption, data))
    if "provenance" in arrays:
        present = np.unique(arrays["provenance"][arrays["mask"]])
        legend = tuple(
            (_css(PALETTE[min(int(code), len(PALETTE) - 1)]), names.get(int(code), f"code {code}")) for code in present
        )
        shown = np.where(arrays["mask"], arrays["provenance"], 0)
        picture = np.where(arrays["mask"][..., None], colour_codes(shown, PALETTE), np.uint8(255))
        pictures.append(
            Picture(
                "Where each normal comes from", "only what is called observed was seen", _png(picture), legend=legend
            )
        )
    if "confidence" in arrays:
        ends = ((_css(_end(0)), "0"), (_css(_end(1)), "1"))
        caption = "probability that the normal's error is below 5 degrees"
        pictures.append(Picture("Confidence", caption, _png(colour_values(arrays["confidence"], 0, 1)), legend=ends))
    reach = _range(arrays.get("depth"))
    if reach is not None:
        low, high = reach
        ends = ((_css(_end(0)), f"{low:.4g} {unit}"), (_css(_end(1)), f"{high:.4g} {unit}"))
        pictures.append(
            Picture(
                "Depth", f"{DEPTH_DIRECTION}, in {unit}", _png(colour_values(arrays["depth"], low, high)), legend=ends
            )
        )
    return pictures


def report_page(report: Mapping[str, Any], pictures: Sequence[Picture]) -> str:
    """The report as one HTML page; every text is escaped."""
    return _template().render(report=report, pictures=pictures, figures=_figures(report))


@cache
def _template() -> "Template":
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(Path(__file__).with_name("report.html").read_text(encoding="utf-8"))


def _figures(report: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Rows of the table: what, how much with its unit, where it comes from."""
    counts, depth, region = report["counts"], report["depth"], report["region"]
    rows = [("Region", f"{region['width']} × {region['height']} pixels", "catalogue or found")]
    if region.get("x") is not None:
        rows.append(("Region's corner in the frame", f"x {region['x']}, y {region['y']} pixels", "catalogue or found"))
    inside = counts["pixels"]
    rows.append(("Object", f"{inside:,} pixels", "mask"))
    rows.append(
        (
            "With a highlight, true or false (M > 0)",
            f"{counts['observed_pixels']:,} pixels, {_share(counts['observed_pixels'], inside)}",
            "clusters",
        )
    )
    for name, number in counts.get("provenance", {}).items():
        rows.append((f"Normals {name}", f"{number:,} pixels, {_share(number, inside)}", "labels"))
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
    seconds = [value for value in report["seconds"].values() if isinstance(value, int | float)]
    if seconds:
        rows.append(("Computing time", f"{sum(seconds):.1f} s in {len(seconds)} stages", "all stages"))
    return rows


def _counts(arrays: Mapping[str, Any], records: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    mask = arrays["mask"]
    counts: dict[str, Any] = {"pixels": int(mask.sum()), "observed_pixels": int(arrays["observed"].sum())}
    if "provenance" in arrays:
        names = code_names(records.get("labels", {}).get("provenance"))
        codes, numbers = np.unique(arrays["provenance"][mask], return_counts=True)
        pairs = zip(codes.tolist(), numbers.tolist(), strict=True)
        counts["provenance"] = {names.get(code, f"code {code}"): number for code, number in pairs}
    if "reason" in arrays:
        names = code_names(records.get("lights", {}).get("reasons"))
        codes, numbers = np.unique(arrays["reason"], return_counts=True)
        frames = list(zip(codes.tolist(), numbers.tolist(), strict=True))
        counts["frames"] = len(arrays["reason"])
        counts["accepted_frames"] = sum(number for code, number in frames if code == 0)
        counts["rejected_frames"] = {names.get(code, f"code {code}"): number for code, number in frames if code != 0}
    if "confidence" in arrays and np.isfinite(arrays["confidence"][mask]).any():
        counts["median_confidence"] = round(float(np.nanmedian(arrays["confidence"][mask])), 4)
    return counts


def _warnings(stage: str, record: Mapping[str, Any]) -> list[dict[str, str]]:
    found = []
    for warning in record.get("warnings") or ():
        parts = warning if isinstance(warning, Mapping) else {"message": warning}
        found.append({"stage": stage, "message": str(parts.get("message", "")), "remedy": str(parts.get("remedy", ""))})
    return found


def _first(records: Mapping[str, Mapping[str, Any]], name: str) -> Any:
    return next((record[name] for record in records.values() if record.get(name) is not None), None)


def _merged(records: Mapping[str, Mapping[str, Any]], name: str) -> dict[str, Any]:
    parts = [record[name] for record in records.values() if isinstance(record.get(name), Mapping)]
    return {key: value for part in parts for key, value in part.items()}


def _range(depth: np.ndarray | None) -> list[float] | None:
    if depth is None or not np.isfinite(depth).any():
        return None
    return [float(np.nanmin(depth)), float(np.nanmax(depth))]


def _share(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f} %" if whole else "of none"


def _title(name: str) -> str:
    stem = Path(name).stem.removeprefix("relit_").replace("_", " ")
    if stem == "surface":
        return "The surface, turned"
    return f"Relit from the {stem}" if stem else "Relit"


def _png(picture: np.ndarray) -> bytes:
    """An inline picture, small ones enlarged by whole factors, large ones reduced."""
    import cv2

    from glint.storage.export.image_files import encode_png

    longest = max(picture.shape[:2])
    if longest > _WIDEST:
        size = tuple(max(1, round(edge * _WIDEST / longest)) for edge in picture.shape[1::-1])
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return encode_png(picture)


def _end(value: float) -> np.ndarray:
    from glint.storage.export.image_files import colour_values

    return colour_values(np.array([[value]]), 0, 1)[0, 0]


def _css(colour: np.ndarray) -> str:
    return "#{:02x}{:02x}{:02x}".format(*(int(part) for part in colour))
