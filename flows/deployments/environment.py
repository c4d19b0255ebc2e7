"""Set up what the flows of deployments need: a checked store, a cluster, and a tag with their process."""

from collections.abc import Iterator
from contextlib import contextmanager

from prefect import get_run_logger, runtime
from prefect.client.orchestration import get_client

from glint.flows.pipeline.context import activate
from glint.flows.pipeline.run import PRELOADED
from glint.flows.runtime.dask_cluster import Cluster
from glint.flows.runtime.environment import prepare_environment
from glint.flows.runtime.orphaned_runs import RUN_TAG, mark_orphaned_crashed, process_tag, tagged_with_process
from glint.storage.locations.conditional_writes import check_conditional_writes
from glint.storage.locations.location import Location


@contextmanager
def run_environment(store: str, scheduler: str | None, workers: int | None) -> Iterator[None]:
    """Check the store and provide the run context of a cluster to the flows that are called inside.

    Raises:
        StoreError, ClusterError: one of them cannot be used.
    """
    prepare_environment()
    check_conditional_writes(Location.parse(store))
    mark_orphaned_crashed()
    with Cluster(scheduler, workers, PRELOADED) as cluster, tagged_with_process(), activate(cluster.client):
        get_run_logger().info(cluster.description)
        yield


def tag_run() -> None:
    """Tag this flow run with its process, by which `flows.runtime.orphaned_runs` recognizes it as orphaned."""
    run_id = runtime.flow_run.id
    if run_id:
        with get_client(sync_client=True) as client:
            client.update_flow_run(run_id, tags=sorted({*runtime.flow_run.tags, RUN_TAG, process_tag()}))
