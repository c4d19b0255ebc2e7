"""The flows of deployments without a schedule: one object, or all objects of a catalogue in flow runs of their own."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from prefect import flow
from prefect.client.schemas.objects import FlowRun, State
from prefect.deployments import run_deployment
from prefect.states import Completed, Failed

from glint.flows.deployments.environment import run_environment, tag_run
from glint.flows.pipeline.object import run_object
from glint.storage.locations.location import Location
from glint.tasks.engine.references import chosen_captures, load_catalogue

ON_DEMAND = "on-demand"
"""Name of the deployments without a schedule."""

MAX_REQUESTED = 16
"""Objects that are requested from the deployment at once; its own limit decides how many of them run."""


@flow(name="run-object", flow_run_name="{object_id}", validate_parameters=False, persist_result=False)
def run_one_object(
    catalogue: str,
    object_id: str,
    store: str,
    scheduler: str | None = None,
    workers: int | None = None,
    captures: Sequence[str] = (),
    drift: float | None = None,
) -> State[None]:
    """Run one object of a catalogue, or some of its captures.

    Args:
        catalogue: The catalogue's YAML file: a path, s3://.. or az://..
        object_id: The object's id in the catalogue.
        store: The store: a folder, s3://bucket/key or az://container/key.
        scheduler: Address of a running Dask scheduler, tls://host:8786; null: a local cluster.
        workers: Processes of the local cluster; null: one per processor.
        captures: Ids of the captures to run; empty: all.
        drift: Warn if the 95th percentile of normal change against the previous version exceeds this many degrees;
            null: do not compare.
    """
    tag_run()
    with run_environment(store, scheduler, workers):
        state: State[Any] = run_object(
            Location.parse(catalogue).uri,
            object_id,
            Location.parse(store).uri,
            captures=list(captures),
            drift=drift,
            return_state=True,
        )
    if state.is_completed():
        return Completed(message=state.message)
    return Failed(message=state.message, name=state.name)


@flow(name="run-catalogue", flow_run_name="{catalogue}", validate_parameters=False, persist_result=False)
def run_objects_separately(
    catalogue: str, store: str, scheduler: str | None = None, only: Sequence[str] = (), drift: float | None = None
) -> State[None]:
    """Run each object of a catalogue as a flow run of run-object/on-demand, to be cancelled and retried by itself.

    Args:
        catalogue: The catalogue's YAML file: a path, s3://.. or az://..
        store: The store: a folder, s3://bucket/key or az://container/key.
        scheduler: Address of a running Dask scheduler, tls://host:8786; null: a local cluster for each object.
        only: Objects (OBJECT) or captures (OBJECT/CAPTURE) to run; empty: all.
        drift: Warn if the 95th percentile of normal change against the previous version exceeds this many degrees;
            null: do not compare.
    """
    tag_run()
    chosen = chosen_captures(load_catalogue(catalogue).objects, only)
    failed = request_objects(catalogue, chosen, store, scheduler, drift)
    if failed:
        name, error = next(iter(failed.items()))
        return Failed(message=f"{len(failed)} of {len(chosen)} objects failed; {name}: {error}")
    return Completed(message=f"{len(chosen)} objects")


def request_objects(
    catalogue: str, objects: Mapping[str, list[str]], store: str, scheduler: str | None, drift: float | None
) -> dict[str, str]:
    """Have run-object/on-demand run objects with these captures (none: all), and wait; return errors by object."""

    def request(object_id: str) -> Any:
        parameters = {
            "catalogue": Location.parse(catalogue).uri,
            "object_id": object_id,
            "store": Location.parse(store).uri,
            "scheduler": scheduler,
            "captures": objects[object_id],
            "drift": drift,
        }
        return run_deployment(f"{run_one_object.name}/{ON_DEMAND}", parameters=parameters, flow_run_name=object_id)

    with ThreadPoolExecutor(MAX_REQUESTED) as pool:
        runs: list[FlowRun] = list(pool.map(request, objects))
    return {
        object_id: f"{run.state.name}: {run.state.message or 'see its flow run'}" if run.state else "it has no state"
        for object_id, run in zip(objects, runs, strict=True)
        if run.state is None or not run.state.is_completed()
    }
