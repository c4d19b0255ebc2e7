"""The flows of deployments with a schedule: inbox scans and reference captures.

They use the Dask scheduler whose address they are given, or else start a local cluster in their own process.
`glint deploy` puts them on a server with their schedules.
"""

from collections.abc import Sequence
from datetime import timedelta

from prefect import flow
from prefect.artifacts import create_markdown_artifact, create_table_artifact
from prefect.client.schemas.objects import State
from prefect.states import Completed, Failed

from glint.flows.deployments.environment import run_environment, tag_run
from glint.flows.pipeline.catalogue import run_whole_catalogue
from glint.flows.reporting.artifacts import artifact_key
from glint.storage.errors import printable
from glint.storage.inbox import Batch, Inbox, InboxScan
from glint.storage.locations.location import Location
from glint.tasks.engine.parameters import Parameters
from glint.tasks.figures.markdown import plain


@flow(name="inbox", flow_run_name="{inbox}", validate_parameters=False, persist_result=False)
def scan_inbox(
    inbox: str,
    store: str,
    scheduler: str | None = None,
    workers: int | None = None,
    quiet_minutes: float = 10.0,
    drift: float | None = None,
    allowed_folders: Sequence[str] = (),
) -> State[None]:
    """Run the new and changed captures of an inbox.

    Args:
        inbox: The inbox: a folder, s3://bucket/prefix or az://container/prefix with one sub-folder per object.
        store: The store: a folder, s3://bucket/key or az://container/key.
        scheduler: Address of a running Dask scheduler, tls://host:8786; null: a local cluster.
        workers: Processes of the local cluster; null: one per processor.
        quiet_minutes: Leave sub-folders that changed within this many minutes for the next scan.
        drift: Warn if the 95th percentile of normal change against the previous version exceeds this many degrees;
            null: do not compare.
        allowed_folders: Folders or prefixes that sub-folders may name besides their own files.
    """
    tag_run()
    place = Inbox(inbox, store, Parameters, allowed_folders)
    scan = place.scan(timedelta(minutes=quiet_minutes))
    failed = {name: f"cannot be run: {problem}" for name, problem in scan.problems.items()}
    if scan.batches:
        with run_environment(store, scheduler, workers):
            for batch in scan.batches:
                errors = _run_batch(batch, store, drift)
                failed |= {batch.submissions[object_id].name: error for object_id, error in errors.items()}
                # A sub-folder of several objects is finished when all of them are.
                place.finish([item for item in batch.submissions.values() if item.name not in failed])
    _create_scan_artifact(inbox, scan, failed)
    if failed:
        name, error = next(iter(failed.items()))
        return Failed(message=f"{len(failed)} sub-folders failed; {printable(name)}: {error}")
    objects = sum(len(batch.submissions) for batch in scan.batches)
    return Completed(message=f"{objects} objects run, {scan.unchanged} up to date, {len(scan.waiting)} waiting")


@flow(name="reference", flow_run_name="{catalogue}", validate_parameters=False, persist_result=False)
def evaluate_reference(
    catalogue: str,
    store: str,
    scheduler: str | None = None,
    workers: int | None = None,
    drift: float = 0.5,
) -> State[None]:
    """Run captures with ground truth, reading all their files again, and evaluate the results.

    Args:
        catalogue: The catalogue's YAML file: a path, s3://.. or az://..
        store: The store: a folder, s3://bucket/key or az://container/key.
        scheduler: Address of a running Dask scheduler, tls://host:8786; null: a local cluster.
        workers: Processes of the local cluster; null: one per processor.
        drift: Warn if the 95th percentile of normal change against the previous version exceeds this many degrees.
    """
    from glint.tasks.evaluation.evaluate_run import contexts_of, evaluate_captures
    from glint.tasks.evaluation.report import capture_tables

    tag_run()
    with run_environment(store, scheduler, workers):
        result = run_whole_catalogue(catalogue, store, rehash=True, drift=drift)
        done = [(capture.object_id, capture.capture_id) for capture in result.captures if not capture.error]
        contexts = contexts_of(catalogue, Location.parse(store).uri, result.run, done)
        evaluations, faults = evaluate_captures(contexts, lambda capture, message: None)
    if evaluations:
        create_markdown_artifact(capture_tables(evaluations), key=artifact_key(f"evaluation {catalogue}"))
    if result.failed:
        first = result.failed[0]
        return Failed(message=f"{len(result.failed)} captures failed; {first.name}: {first.error} -> {first.remedy}")
    for name, fault in faults.items():
        return Failed(message=f"{len(faults)} ground truths cannot be used; {name}: {fault.message} -> {fault.remedy}")
    changed = f", {len(result.drifts)} changed beyond {drift:g} degrees" if result.drifts else ""
    return Completed(message=f"{len(evaluations)} captures evaluated{changed}")


def _run_batch(batch: Batch, store: str, drift: float | None) -> dict[str, str]:
    """Run the objects of a batch; return the errors of those that failed at least in part, by object."""
    result = run_whole_catalogue(batch.catalogue, store, list(batch.submissions), drift=drift)
    # The first error of an object wins.
    return {item.object_id: f"{item.name}: {item.error} -> {item.remedy}" for item in reversed(result.failed)}


def _create_scan_artifact(inbox: str, scan: InboxScan, failed: dict[str, str]) -> None:
    """Put a table of all sub-folders on the dashboard, except those that were finished before."""
    rows = [
        (submission.name, object_id, failed.get(submission.name, "done"))
        for batch in scan.batches
        for object_id, submission in batch.submissions.items()
    ]
    rows += [(name, "", failed[name]) for name in scan.problems]
    rows += [(name, "", "changed recently: next scan") for name in scan.waiting]
    rows += [(name, "", "no footage") for name in scan.empty]
    table = [{"sub-folder": plain(name), "object": plain(item), "result": plain(result)} for name, item, result in rows]
    create_table_artifact(table, key=artifact_key(f"inbox {inbox}"), description=plain(inbox))
