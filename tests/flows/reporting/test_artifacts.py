import json
from types import SimpleNamespace
from typing import Any, cast

import pytest
from prefect import flow, runtime

from glint.flows.reporting import artifacts
from glint.flows.reporting.artifacts import artifact_key, create_catalogue_artifact, create_page_artifact, problems_page
from glint.flows.results import CaptureResult, ObjectResult, RunResult
from glint.flows.runtime.prefect_server import Server
from glint.tasks.engine.stage import StageRecord
from glint.tasks.engine.stage_warning import StageWarning
from tests.prefect_api import ask

RECORDS = (
    StageRecord("frames", "k", False, 12.345, {"frames": 8000}, ()),
    StageRecord(
        "lights", "k", False, 1.2, {"accepted": 7810}, (StageWarning("only <b>3%</b> of [this](x) | *that*", "light"),)
    ),
    StageRecord("depth", "k", True, 0.01, {}, ()),
)


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("wine-glass/front", "wine-glass--front"),
        ("catalogue glassware", "catalogue-glassware"),
        ("Wine_Glass.2/front", "wine-glass-2--front-2dd32864"),
        ("../..", "0cfd1c96"),
    ],
)
def test_keys_are_what_prefect_accepts(name: str, key: str) -> None:
    assert artifact_key(name) == key


def test_captures_have_different_keys() -> None:
    names = ["a-b/c", "a/b-c", "a.b/c", "a_b/c", "a--b/c", "a/b", "a-b"]
    assert len({artifact_key(name) for name in names}) == len(names)


def result() -> RunResult:
    failed = CaptureResult("glass", "back", 0.5, (), "no light in any frame", "film again with the lamp in view")
    captures = (CaptureResult("glass", "front", 13.5, RECORDS), failed)
    return RunResult("run", (ObjectResult("glass", captures, cast(Any, SimpleNamespace(name="v2"))),), 14.0)


def test_problems_say_what_to_do() -> None:
    page = problems_page(result().failed)
    assert "**[glass/back](http://127.0.0.1:4300/#/glass/back/inputs)**: no light in any frame: film again" in page
    assert "glass/front" not in page


@pytest.mark.server
def test_a_run_has_its_table_and_its_problems_on_the_server(server: Server) -> None:
    @flow
    def run() -> str:
        create_catalogue_artifact("glassware", result())
        create_page_artifact("glass/front", "# The page")
        return str(runtime.flow_run.id)

    found = ask(f"{server.api_url}/artifacts/filter", {"flow_runs": {"id": {"any_": [run()]}}})
    artifacts = {artifact["key"]: artifact for artifact in found}
    assert set(artifacts) == {"catalogue-glassware", "problems-glassware", "glass--front"}
    assert "](http://127.0.0.1:4300/#/glass/front/inputs)" in artifacts["glass--front"]["data"]
    second, first = json.loads(artifacts["catalogue-glassware"]["data"])  # failures come first
    assert (first["capture"], first["state"], first["version"], first["frames"]) == ("glass/front", "done", "v2", 8000)
    assert (second["capture"], second["state"], second["frames"]) == ("glass/back", "failed", None)


def test_large_catalogues_have_short_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: dict[str, Any] = {}
    monkeypatch.setattr(artifacts, "create_table_artifact", lambda table, **about: shown.update(about, table=table))
    monkeypatch.setattr(artifacts, "create_markdown_artifact", lambda page, **about: shown.update(page=page))
    good = [ObjectResult(f"o{n}", (CaptureResult(f"o{n}", "front", 1.0, RECORDS),)) for n in range(2000)]
    bad = [ObjectResult(f"b{n}", (CaptureResult(f"b{n}", "front", 1.0, (), "dark", "light"),)) for n in range(600)]
    create_catalogue_artifact("large", RunResult("run", (*good, *bad), 1.0))
    assert len(shown["table"]) == 500 and {row["state"] for row in shown["table"]} == {"failed"}
    assert "2,100 more" in shown["description"] and "and 100 more" in shown["page"]
