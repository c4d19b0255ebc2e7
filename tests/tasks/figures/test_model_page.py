"""The dashboard's page of a model."""

import numpy as np
import pytest

from glint.tasks.engine.stage import StageRecord
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.figures.model_page import rounded, sheet_page

VIEWS = [
    {"capture": "view-01", "pose": "found", "outline_misses_pixels": 0.123, "share": 0.25},
    {"capture": "view-00", "pose": "solved", "outline_misses_pixels": 0.0, "share": 0.75},
]
ABOUT = {
    "unit": "mm",
    "views": VIEWS,
    "left_out": [{"name": "view-02", "reason": "its silhouette contradicts the others' by 4.0 pixels"}],
    "turntable": {
        "leans_to_camera_degrees": 1.25,
        "leans_to_the_right_degrees": -0.5,
        "angles": {"view-00": 0.0, "view-01": 44.96},
    },
    "seen": 0.914,
    "unseen": 0.031,
    "volume": 22630.4,
    "area": 51.5912,
}
RECORD = StageRecord(
    "model", "k", False, 42.0, {"views": 2}, (StageWarning("view-02 is not part of the model", "views"),)
)
SHEET = np.full((520, 780, 3), 255, np.uint8)


def test_the_page_of_a_turntable() -> None:
    page = sheet_page("fish/model", SHEET, ABOUT, [RECORD])
    assert page.count("data:image/png") == 1
    assert "91% of the surface known, 3% seen by no view" in page.replace("\\", "")
    assert "volume 22,630 mm³, area 51.59 mm²" in page
    rows = [line.replace("\\", "") for line in page.splitlines() if line.startswith("| view") and "left" not in line]
    assert rows[1:] == [
        "| view-00 | solved: 0.0 degrees | 0.00 | 75% |",
        "| view-01 | found: 45.0 degrees | 0.12 | 25% |",
    ]
    assert "| view-02 | left out | | |" in page.replace("\\", "")
    assert "leans 1.25 degrees to the camera and -0.50 to the right" in page.replace("\\", "")


def test_the_page_of_matrices() -> None:
    views = [{**model_view, "pose": "given"} for model_view in VIEWS]
    page = sheet_page("fish/model", SHEET, {**ABOUT, "views": views, "turntable": None, "left_out": []}, [RECORD])
    assert "| view-00 | given | 0.00 | 75% |" in page.replace("\\", "")
    assert "leans" not in page


@pytest.mark.parametrize(
    ("value", "text"), [(22630.4, "22,630"), (51.5912, "51.59"), (0.000123456, "0.0001235"), (0, "0")]
)
def test_numbers_have_four_digits(value: float, text: str) -> None:
    assert rounded(value) == text
