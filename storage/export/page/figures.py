"""A report's figures as rows of a table."""

from collections.abc import Mapping
from typing import Any


def figures(report: Mapping[str, Any]) -> list[tuple[str, str, str]]:
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
