"""Deployments on a real server, run by a real worker: inbox scans, limits, cancellation, notifications."""

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import pytest
from prefect.blocks.notifications import CustomWebhookNotificationBlock
from prefect.client.orchestration import get_client
from prefect.client.schemas.filters import (
    ArtifactFilter,
    ArtifactFilterKey,
    FlowRunFilter,
    FlowRunFilterState,
    FlowRunFilterStateType,
    LogFilter,
    LogFilterFlowRunId,
)
from prefect.client.schemas.objects import FlowRun, State, StateType
from prefect.deployments import run_deployment
from prefect.events import emit_event
from prefect.states import Cancelling
from prefect.utilities.callables import parameter_schema

from glint.flows.deployments.deploy import DeploymentOptions, deploy, deployment_specs
from glint.flows.deployments.inbox_runs import inbox_runs, start_inbox_run, unserved_pool
from glint.flows.errors import ServerError
from glint.flows.pipeline.drift import DRIFT_EVENT
from glint.flows.reporting.artifacts import artifact_key
from glint.flows.runtime.prefect_server import Server
from glint.storage.errors import InputError
from glint.storage.locations.location import Location
from glint.storage.locking.locks import run_owner
from glint.storage.versions.repository import ObjectRepository
from tests.polling import PATIENCE, until
from tests.scene import draw_scene

pytestmark = [pytest.mark.slow, pytest.mark.server]


class NotificationServer(ThreadingHTTPServer):
    """Records notifications."""

    def __init__(self) -> None:
        self.bodies: list[str] = []
        super().__init__(("127.0.0.1", 0), _Handler)


class _Handler(BaseHTTPRequestHandler):
    server: NotificationServer

    def do_POST(self) -> None:
        self.server.bodies.append(self.rfile.read(int(self.headers["Content-Length"])).decode())
        self.send_response(204)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Keep the output of the tests clean."""


@pytest.fixture(scope="module")
def notifications(server: Server) -> Iterator[NotificationServer]:
    with NotificationServer() as listener:
        threading.Thread(target=listener.serve_forever, daemon=True).start()
        CustomWebhookNotificationBlock(
            name="lab",
            url=f"http://127.0.0.1:{listener.server_port}",
            json_data={"subject": "{{subject}}", "body": "{{body}}"},
            headers=None,
            cookies=None,
        ).save("lab")
        yield listener
        listener.shutdown()


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Inbox and store: a good object, and one whose mask is of another size."""
    folder = tmp_path_factory.mktemp("folders")
    scene = draw_scene(folder / "inbox" / "ellipsoid", frames=150)
    broken = folder / "inbox" / "broken"
    broken.mkdir()
    for name in ("front.mp4", "mask.png"):
        (broken / name).write_bytes((scene.catalogue.parent / name).read_bytes())
    return folder / "inbox", folder / "store"


@pytest.fixture(scope="module")
def deployed(worker: str, notifications: NotificationServer, folders: tuple[Path, Path]) -> list[str]:
    inbox, store = folders
    reference = inbox / "ellipsoid" / "catalogue.yaml"
    options = DeploymentOptions(
        str(store), str(inbox), str(reference), pool=worker, timezone="Europe/Berlin", notify="custom-webhook/lab"
    )
    assert deploy(options) == deploy(options)
    return deploy(options)


def read_run(run_id: Any) -> FlowRun:
    with get_client(sync_client=True) as client:
        return client.read_flow_run(run_id)


def read(run: FlowRun) -> FlowRun:
    with get_client(sync_client=True) as client:
        return client.read_flow_run(run.id)


def scheduled() -> list[FlowRun]:
    """Flow runs that the server has planned."""
    planned = FlowRunFilter(state=FlowRunFilterState(type=FlowRunFilterStateType(any_=[StateType.SCHEDULED])))
    with get_client(sync_client=True) as client:
        return client.read_flow_runs(flow_run_filter=planned)


def call(name: str, **parameters: Any) -> FlowRun:
    run: Any = run_deployment(name, parameters=parameters, timeout=PATIENCE, poll_interval=0.5)
    return run


def test_schedules_have_their_zone_and_limits(deployed: list[str]) -> None:
    with get_client(sync_client=True) as client:
        nightly = client.read_deployment_by_name("inbox/nightly")
        limits = {name: client.read_deployment_by_name(name).global_concurrency_limit for name in deployed}
    planned = until(lambda: [run for run in scheduled() if run.deployment_id == nightly.id])
    starts = [run.expected_start_time for run in planned]
    assert all(start is not None and start.astimezone(ZoneInfo("Europe/Berlin")).hour == 2 for start in starts)
    (schedule,) = nightly.schedules
    assert schedule.schedule.model_dump()["timezone"] == "Europe/Berlin"
    assert {name: limit.limit for name, limit in limits.items() if limit} == {
        "inbox/nightly": 1, "reference/weekly": 1, "maintenance/weekly": 1, "run-catalogue/on-demand": 1,
        "run-object/on-demand": 4,
    }  # fmt: skip


def log_of(run: FlowRun) -> list[str]:
    with get_client(sync_client=True) as client:
        chosen = LogFilter(flow_run_id=LogFilterFlowRunId(any_=[run.id]))
        return [line.message for line in client.read_logs(chosen)]


def test_the_server_describes_every_parameter(deployed: list[str]) -> None:
    with get_client(sync_client=True) as client:
        for deployment in client.read_deployments():
            schema = deployment.parameter_openapi_schema or {}
            for name, about in schema["properties"].items():
                assert about.get("description"), f"{deployment.name}: {name}"


def test_the_inbox_is_scanned_at_once_on_request(deployed: list[str]) -> None:
    started = start_inbox_run("inbox/nightly")
    assert unserved_pool("inbox/nightly") is None
    until(lambda: (state := read_run(started).state) and state.is_final())
    assert any(row["state"] not in ("", "Scheduled") for row in inbox_runs("inbox/nightly", 10))
    with pytest.raises(ServerError, match=r"no deployment inbox/other.*glint deploy"):
        start_inbox_run("inbox/other")


def test_an_inbox_is_run_once_and_its_failure_is_notified(
    deployed: list[str], notifications: NotificationServer, folders: tuple[Path, Path]
) -> None:
    inbox, store = folders
    first = call("inbox/nightly", quiet_minutes=0.0, workers=1)
    assert first.state is not None and first.state.type == StateType.FAILED
    assert "broken/front: the mask" in str(first.state.message)
    assert ObjectRepository.open(Location.parse(store), "ellipsoid", create=False).version().name == "v1"
    until(lambda: any("broken/front" in body and "inbox" in body for body in notifications.bodies))
    until(lambda: any("workers 1, Dask's dashboard http://127.0.0.1:" in line for line in log_of(first)))
    (inbox / "broken" / "mask.png").unlink()
    (inbox / "broken" / "front.mp4").rename(inbox / "broken" / "front.txt")
    second = call("inbox/nightly", quiet_minutes=0.0, workers=1)
    assert second.state is not None and second.state.is_completed()
    assert second.state.message == "0 objects run, 1 up to date, 0 waiting"
    with get_client(sync_client=True) as client:
        key = ArtifactFilter(key=ArtifactFilterKey(any_=[artifact_key(f"inbox {inbox}")]))
        tables = [str(artifact.data) for artifact in client.read_artifacts(artifact_filter=key)]
    assert any("no footage" in table for table in tables)


def test_the_reference_is_evaluated_against_its_truth(deployed: list[str], folders: tuple[Path, Path]) -> None:
    run = call("reference/weekly", workers=1)
    assert run.state is not None and run.state.message == "1 captures evaluated"


def test_objects_run_separately(deployed: list[str], folders: tuple[Path, Path]) -> None:
    run = call("run-catalogue/on-demand", catalogue=str(folders[0] / "ellipsoid" / "catalogue.yaml"), drift=None)
    assert run.state is not None and run.state.is_completed(), run.state
    with get_client(sync_client=True) as client:
        flows = {flow.id: flow.name for flow in client.read_flows()}
        assert "run-object" in {flows[run.flow_id] for run in client.read_flow_runs()}


def test_a_second_scan_at_the_same_time_is_cancelled(deployed: list[str]) -> None:
    runs: list[Any] = [run_deployment("inbox/nightly", timeout=0) for _ in range(2)]

    def ends() -> list[State] | None:
        states = [state for run in runs if (state := read(run).state) is not None and state.is_final()]
        return states if len(states) == len(runs) else None

    assert sorted(end.type.value for end in until(ends)) == ["CANCELLED", "COMPLETED"]


def test_a_cancelled_object_releases_its_lock(deployed: list[str], folders: tuple[Path, Path], tmp_path: Path) -> None:
    scene = draw_scene(tmp_path / "long", frames=2000)
    place = Location.parse(tmp_path / "store")
    run: Any = run_deployment(
        "run-object/on-demand",
        parameters={
            "catalogue": str(scene.catalogue), "object_id": "ellipsoid", "store": place.uri, "workers": 1,
        },
        timeout=0,
    )  # fmt: skip
    until(lambda: run_owner(place, "ellipsoid"))
    with get_client(sync_client=True) as client:
        client.set_flow_run_state(run.id, Cancelling(), force=True)
    until(lambda: (state := read(run).state) and state.is_final())
    end = read(run).state
    assert end is not None and end.type == StateType.CANCELLED
    until(lambda: run_owner(place, "ellipsoid") is None)


def test_drift_is_notified(deployed: list[str], notifications: NotificationServer) -> None:
    payload = {"object": "duck", "capture": "front", "degrees": 3.25, "before": "v1", "after": "v2"}
    emit_event(DRIFT_EVENT, resource={"prefect.resource.id": "glint.object.duck"}, payload=payload)
    until(
        lambda: any(
            "duck/front: the 95th percentile of normal change from v1 to v2 is 3.25 degrees" in body
            for body in notifications.bodies
        )
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (DeploymentOptions("store", "inbox", timezone="Berlin"), "--timezone 'Berlin' is not a time zone"),
        (DeploymentOptions("store", "inbox", nightly="every night"), "--nightly 'every night' is not a schedule"),
        (DeploymentOptions("store", weekly="61 * * * *"), "--weekly .* is not a schedule"),
        (DeploymentOptions("store", "inbox", pool_type="proces", pool="other"), "is not a type of work pool"),
        (DeploymentOptions("store", "inbox", notify="slack-webhook/none"), "no notification block"),
        (DeploymentOptions("store", "inbox", pool_type="docker"), "has the type process"),
    ],
)
def test_unusable_options_are_refused(deployed: list[str], options: DeploymentOptions, message: str) -> None:
    with pytest.raises((InputError, ServerError), match=message):
        deploy(options)


def test_addresses_are_absolute() -> None:
    addresses = {
        f"{spec.flow.name}/{spec.name}": {
            name: value for name, value in spec.parameters.items() if name in ("store", "inbox", "catalogue")
        }
        for spec in deployment_specs(DeploymentOptions("store", "inbox", "catalogue.yaml"))
    }
    assert {name: set(given) for name, given in addresses.items()} == {
        "maintenance/weekly": {"store"},
        "run-object/on-demand": {"store"},
        "run-catalogue/on-demand": {"store"},
        "inbox/nightly": {"store", "inbox"},
        "reference/weekly": {"store", "catalogue"},
    }
    assert all(Path(address).is_absolute() for given in addresses.values() for address in given.values())


def test_every_parameter_of_a_deployment_is_described() -> None:
    for spec in deployment_specs(DeploymentOptions("store", "inbox", "catalogue.yaml")):
        for name, about in parameter_schema(spec.flow.fn).properties.items():
            assert about.get("description", "").endswith("."), f"{spec.flow.name}: {name}"
