import base64
import json
import re
import urllib.request
from types import SimpleNamespace
from typing import Any, cast

import cv2
import numpy as np
import pytest
from prefect import flow, runtime

from glint.flows.reporting import artifacts
from glint.flows.reporting.artifacts import (
    LARGEST_PAGE,
    artifact_key,
    capture_page,
    catalogue_artifact,
    plain,
    problems_page,
)
from glint.flows.results import CaptureResult, ObjectResult, RunResult
from glint.flows.runtime.prefect_server import Server
from glint.tasks.engine.stage import Record

RECORDS = (
    Record("frames", "k", False, 12.345, {"frames": 8000}, ()),
    Record("lights", "k", False, 1.2, {"accepted": 7810}, ("only <b>3%</b> of [this](x) | *that*",)),
    Record("depth", "k", True, 0.01, {}, ()),
)


def pictures_of(page: str) -> list[np.ndarray]:
    found = re.findall(r"data:image/png;base64,([A-Za-z0-9+/=]+)\)", page)
    return [cast(np.ndarray, cv2.imdecode(np.frombuffer(base64.b64decode(each), np.uint8), -1)) for each in found]


def test_a_page_shows_pictures_stages_and_warnings() -> None:
    red = np.zeros((90, 60, 3), np.uint8)
    red[..., 0] = 200
    page = capture_page("glass/front", {"Normals": red, "Coverage": red}, RECORDS)
    assert [picture.shape for picture in pictures_of(page)] == [(90, 60, 3)] * 2
    assert pictures_of(page)[0][0, 0].tolist() == [0, 0, 200]
    assert "| frames | 12.35 | frames 8,000 |" in page
    assert "| depth | unchanged |  |" in page
    assert "| all | 13.54 | |" in page
    assert page.index("## Warnings") < page.index("| stage |")


def test_no_warnings_no_heading() -> None:
    assert "Warnings" not in capture_page("glass/front", {}, RECORDS[:1])


@pytest.mark.parametrize("count", [1, 2, 4])
def test_a_page_stays_small_whatever_its_pictures(count: int) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (1500, 1200, 3), dtype=np.uint8)
    page = capture_page("glass/front", {f"Noise {number}": noise for number in range(count)}, RECORDS)
    assert len(page) <= LARGEST_PAGE
    shapes = [picture.shape for picture in pictures_of(page)]
    assert len(shapes) == count
    assert all(abs(height / width - 1.25) < 0.05 for height, width, _ in shapes)


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


@pytest.mark.parametrize(
    ("name", "key"),
    [("Wine_Glass.2/front", "wine-glass-2-front"), ("../..", "capture"), ("catalogue Gläser", "catalogue-gl-ser")],
)
def test_keys_are_what_prefect_accepts(name: str, key: str) -> None:
    assert artifact_key(name) == key


def result() -> RunResult:
    failed = CaptureResult("glass", "back", 0.5, (), "no light in any frame", "film again with the lamp in view")
    captures = (CaptureResult("glass", "front", 13.5, RECORDS), failed)
    return RunResult("run", (ObjectResult("glass", captures, cast(Any, SimpleNamespace(name="v2"))),), 14.0)


def test_problems_say_what_to_do() -> None:
    page = problems_page(result().failed)
    assert "**glass/back**: no light in any frame: film again with the lamp in view" in page
    assert "glass/front" not in page


@pytest.mark.server
def test_a_run_has_its_table_and_its_problems_on_the_server(server: Server) -> None:
    @flow
    def run() -> str:
        catalogue_artifact("glassware", result())
        return str(runtime.flow_run.id)

    asked = json.dumps({"flow_runs": {"id": {"any_": [run()]}}}).encode()
    request = urllib.request.Request(
        f"{server.api_url}/artifacts/filter", asked, {"Content-Type": "application/json"}, method="POST"
    )
    with urllib.request.urlopen(request) as answer:
        artifacts = {each["key"]: each for each in json.load(answer)}
    assert set(artifacts) == {"catalogue-glassware", "problems-glassware"}
    second, first = json.loads(artifacts["catalogue-glassware"]["data"])  # failures come first
    assert (first["capture"], first["state"], first["version"], first["frames"]) == ("glass/front", "done", "v2", 8000)
    assert (second["capture"], second["state"], second["frames"]) == ("glass/back", "failed", None)


def test_large_catalogues_have_small_pages_and_short_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (320, 320, 3)).astype(np.uint8)
    assert len(capture_page("glass/front", {"Noise": noise}, RECORDS, largest=20_000)) <= 20_000
    shown: dict[str, Any] = {}
    monkeypatch.setattr(artifacts, "create_table_artifact", lambda table, **about: shown.update(about, table=table))
    monkeypatch.setattr(artifacts, "create_markdown_artifact", lambda page, **about: shown.update(page=page))
    good = [ObjectResult(f"o{n}", (CaptureResult(f"o{n}", "front", 1.0, RECORDS),)) for n in range(2000)]
    bad = [ObjectResult(f"b{n}", (CaptureResult(f"b{n}", "front", 1.0, (), "dark", "light"),)) for n in range(600)]
    catalogue_artifact("large", RunResult("run", (*good, *bad), 1.0))
    assert len(shown["table"]) == 500 and {row["state"] for row in shown["table"]} == {"failed"}
    assert "2,100 more" in shown["description"] and "and 100 more" in shown["page"]
