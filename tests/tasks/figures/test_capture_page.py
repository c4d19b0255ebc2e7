"""Pages of captures: pictures, stages, warnings, and their size."""

import base64
import re
import shlex

import numpy as np
import pytest

from glint.storage.locations.location import Location
from glint.tasks.engine.stage import StageRecord
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.figures.capture_page import MAX_PAGE_CHARS, file_lines, picture_page
from glint.tasks.figures.markdown import plain
from tests.pictures import decode_picture

RECORDS = (
    StageRecord("frames", "k", False, 12.345, {"frames": 8000}, ()),
    StageRecord(
        "lights", "k", False, 1.2, {"accepted": 7810}, (StageWarning("only <b>3%</b> of [this](x) | *that*", "light"),)
    ),
    StageRecord("depth", "k", True, 0.01, {}, ()),
)


def pictures_of(page: str) -> list[np.ndarray]:
    found = re.findall(r"data:image/png;base64,([A-Za-z0-9+/=]+)\)", page)
    return [decode_picture(base64.b64decode(encoded)) for encoded in found]


def test_a_page_shows_pictures_stages_and_warnings() -> None:
    red = np.zeros((90, 60, 3), np.uint8)
    red[..., 0] = 200
    page = picture_page("glass/front", {"Normals": red, "Coverage": red}, RECORDS)
    assert [picture.shape for picture in pictures_of(page)] == [(90, 60, 3)] * 2
    assert pictures_of(page)[0][0, 0].tolist() == [0, 0, 200]
    assert "| frames | 12.35 | frames 8,000 |" in page
    assert "| depth | up to date |  |" in page
    assert "| all | 13.54 | |" in page
    assert page.index("## Warnings") < page.index("| stage |")


def test_the_command_of_a_page_can_be_pasted_into_a_shell() -> None:
    lines = file_lines(Location("file", "", "/data/my store; it's"), "duck", {})
    assert shlex.split(lines[-1])[-2:] == ["--store", "/data/my store; it's"]


def test_no_warnings_no_heading() -> None:
    assert "Warnings" not in picture_page("glass/front", {}, RECORDS[:1])


@pytest.mark.parametrize("count", [1, 2, 4])
def test_a_page_stays_small_whatever_its_pictures(count: int) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (1500, 1200, 3), dtype=np.uint8)
    page = picture_page("glass/front", {f"Noise {number}": noise for number in range(count)}, RECORDS)
    assert len(page) <= MAX_PAGE_CHARS
    shapes = [picture.shape for picture in pictures_of(page)]
    assert len(shapes) == count
    assert all(abs(height / width - 1.25) < 0.05 for height, width, _ in shapes)


def test_pages_of_large_catalogues_are_small() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (320, 320, 3)).astype(np.uint8)
    assert len(picture_page("glass/front", {"Noise": noise}, RECORDS, max_chars=20_000)) <= 20_000


@pytest.mark.parametrize(
    "text",
    ["<script>alert(1)</script>", "a | b", "*a* _b_ `c`", "[x](http://y)", "# a\n# b", "![x](y)", "a & b", "~~a~~"],
)
def test_any_text_is_shown_as_it_is(text: str) -> None:
    from markdown_it import MarkdownIt

    shown = MarkdownIt("commonmark").enable(["table", "strikethrough"]).render(f"| head |\n|---|\n| {plain(text)} |\n")
    cell = re.search(r"<td>(.*)</td>", shown, re.DOTALL)
    assert cell is not None
    assert "<" not in cell[1]
    unescaped = cell[1].replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", '"').replace("&amp;", "&")
    assert unescaped == " ".join(text.split())
