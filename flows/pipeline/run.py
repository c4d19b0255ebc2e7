"""A whole run: server and cluster started while the catalogue is read, the flow, and what to say at the end."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from glint.flows.reporting.events import Display, Event
from glint.flows.runtime import signals
from glint.flows.runtime.prefect_server import start_server

if TYPE_CHECKING:
    from prefect.client.schemas.objects import State

    from glint.flows.results import RunResult
    from glint.storage.locations.location import Location

WARMED = ("glint.tasks.pipeline", "glint.tasks.warm_up")
"""Modules that every worker imports before its first task."""


@dataclass(frozen=True, slots=True)
class Summary:
    """The run's result, and its page on the dashboard."""

    result: "RunResult"
    page: str


def run(
    catalogue: str | Path, store: str, display: Display, *, only: Sequence[str] = (), scheduler: str | None = None,
    workers: int | None = None, rehash: bool = False, drift: float | None = None,
) -> Summary:  # fmt: skip
    """Run a catalogue; `drift`: degrees by which an object's normals may move against its version before unannounced.

    Raises:
        CatalogueError, InputError: the catalogue is unusable; RunningError: server or cluster are.
    """
    from glint.storage.locations.conditional_writes import check_conditional_writes
    from glint.storage.locations.location import Location
    from glint.storage.maintenance.disk_space import REMEDY
    from glint.tasks.engine.references import chosen_captures, load_catalogue

    loaded, place = load_catalogue(catalogue), Location.parse(store)
    chosen = chosen_captures(loaded.objects, only)
    check_conditional_writes(place)
    server = start_server()
    warning = _room_warning(place, chosen)
    if warning:
        display.show(Event("message", text=f"{warning}: {REMEDY}"))
    # Server and cluster start side by side while this process imports the rest.
    from glint.flows.runtime.dask_cluster import Cluster

    with Cluster(scheduler, workers, WARMED) as cluster:
        from glint.flows.pipeline.catalogue import run_catalogue
        from glint.flows.pipeline.context import share, side_by_side
        from glint.flows.runtime.orphaned_runs import close_own_runs, close_runs_of_the_dead, tagged

        server.wait()
        share(cluster.address, cluster.client, display)
        display.show(Event("message", text=f"dashboard {server.ui_url}, {cluster.described}"))
        with server.connected(), tagged():
            close_runs_of_the_dead()
            signals.check()
            state: Any = run_catalogue(
                Location.parse(catalogue).uri,
                loaded.name,
                place.uri,
                cluster.address,
                only=list(only),
                side_by_side=side_by_side(cluster.workers),
                rehash=rehash,
                drift=drift,
                return_state=True,
            )
            close_own_runs()
            result: RunResult = result_of(state)
        return Summary(result, f"{server.ui_url}/runs/flow-run/{result.run}")


def _room_warning(place: "Location", chosen: dict[str, list[str]]) -> str:
    """What to say when the captures that are new to the store may not fit on its disk."""
    from glint.storage.maintenance.disk_space import new_objects, room_of

    room = room_of(place)
    return "" if room is None else room.warning(sum(len(chosen[each]) for each in new_objects(place, list(chosen))))


def result_of(state: "State[Any]") -> Any:
    """The result that a flow run left in its final state, whatever that is.

    Raises:
        BaseException: what ended the flow run instead of a result.
    """
    result = state.result(raise_on_failure=False)
    if isinstance(result, BaseException):
        raise result
    return result
