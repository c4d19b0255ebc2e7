"""Whatever the interface's own description allows, and what it does not, is sent to it: it answers, and never fails."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
import requests
import schemathesis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from schemathesis.core.result import Ok
from schemathesis.specs.openapi import checks as openapi_checks

from glint.storage.edits.edits import Edits
from glint.storage.locations.location import Location
from tests.flows.review.conftest import ServedPage, serve
from tests.polling import until

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

STORED = {
    "object_id": "hemisphere", "capture_id": "front", "version": "v1", "before": "v1", "after": "v1", "part": "normals",
}  # fmt: skip
"""Names of what the store has, with which a request gets beyond the search for its object."""
STARTS_A_PROCESS = {"POST /api/captures/{object_id}/{capture_id}/run", "POST /api/objects/{object_id}/run"}
EXAMPLES = 15
"""Requests of each kind, for each operation."""
TIMEOUT_S = 250
"""Longest wait for an answer: the first fit of a sphere compiles its program, and several share the machine."""
CHECKS = [
    schemathesis.checks.not_a_server_error,
    openapi_checks.status_code_conformance,
    openapi_checks.content_type_conformance,
    openapi_checks.response_schema_conformance,
]


@pytest.fixture(scope="module")
def fuzzed(stored: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedPage]:
    """The page of a copy of the store, which what is sent may change."""
    folder = tmp_path_factory.mktemp("fuzzed")
    shutil.copytree(stored[0], folder / "store")
    page = serve(folder / "store", stored[1])
    # Hypothesis goes through all modules, so none may be imported meanwhile, as the first questions have it.
    address = f"{page.origin}/api/captures/hemisphere/front/questions"
    requests.get(address, headers=page.session, timeout=TIMEOUT_S).raise_for_status()
    until(lambda: page.app.state.review.preparation.is_idle)
    yield page
    page.stop()


def test_no_request_makes_the_server_fail(fuzzed: ServedPage) -> None:
    beside = set(fuzzed.store.parent.iterdir())
    schema = schemathesis.openapi.from_url(f"{fuzzed.origin}/api/openapi.json", headers=fuzzed.session)
    results = list(schema.get_all_operations())
    operations = [result.ok() for result in results if isinstance(result, Ok)]
    assert len(operations) == len(results) >= 20
    assert {operation.label for operation in operations} > STARTS_A_PROCESS
    with requests.Session() as session:
        session.headers.update(fuzzed.session)
        for operation in operations:
            names = {item.name for item in operation.path_parameters}
            known = {name: value for name, value in STORED.items() if name in names}
            steered = [{}] if operation.label in STARTS_A_PROCESS else [{}, known]
            cases = [
                operation.as_strategy(generation_mode=mode, path_parameters=given_names or None)
                for mode in schemathesis.GenerationMode
                for given_names in steered
            ]

            @given(case=st.one_of(cases))
            @settings(
                max_examples=EXAMPLES * len(cases), derandomize=True, database=None, deadline=None,
                suppress_health_check=list(HealthCheck),
            )  # fmt: skip
            def answers(case: schemathesis.Case) -> None:
                case.call_and_validate(session=session, checks=CHECKS, timeout=TIMEOUT_S)

            answers()
    assert set(fuzzed.store.parent.iterdir()) == beside
    assert {path.name for path in (fuzzed.store / "objects").iterdir()} == {"hemisphere"}
    edits = Edits.open(Location.parse(fuzzed.store), "hemisphere", create=False)
    assert set(edits.captures()) <= {"front"}, "what was accepted belongs to a capture that exists"
