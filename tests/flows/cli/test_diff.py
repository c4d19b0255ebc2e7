"""The table of `glint diff`: figures with their units."""

from glint.flows.cli.diff import diff_row, in_yaml

FIGURES = {
    "capture": "front",
    "pixels": 6016,
    "mean angle": 0.5181,
    "angle of 95%": 2.0188,
    "largest angle": 25.7562,
    "moved beyond 5°": 0.0188,
    "depth, root mean square": 0.4176,
    "unit of depth": "pixels",
}


def test_figures_have_their_units() -> None:
    row = diff_row(FIGURES)
    assert list(row.values()) == ["front", 6016, "0.52°", "2.02°", "25.76°", "1.9%", "0.418 pixels"]


def test_versions_without_a_common_pixel_leave_cells_empty() -> None:
    missing = {name: None for name in FIGURES if name not in ("capture", "pixels", "unit of depth")}
    assert list(diff_row({**FIGURES, "pixels": 0, **missing}).values()) == ["front", 0, "", "", "", "", ""]


def test_changed_values_are_shown_as_a_catalogue_gives_them() -> None:
    assert [in_yaml(value) for value in (None, True, 0.7, "sheets")] == ["null", "true", 0.7, "sheets"]
