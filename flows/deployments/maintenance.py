"""The maintenance flow: collect garbage in a store, keep its cache of frames within a budget, warn of a full disk."""

from datetime import timedelta

from prefect import flow
from prefect.artifacts import create_markdown_artifact, create_table_artifact
from prefect.client.schemas.objects import State
from prefect.events import emit_event
from prefect.states import Completed, Failed

from glint.flows.reporting.artifacts import artifact_key
from glint.storage.locations.location import Location
from glint.storage.maintenance.disk_space import DISK_SPACE_REMEDY
from glint.storage.maintenance.maintain import Maintenance, maintain
from glint.storage.maintenance.verify import verify_store
from glint.tasks.figures.markdown import plain

DISK_EVENT = "glint.disk-low"
"""Name of the event; its resource is `glint.store`, its payload the store, the warning and the remedy."""


@flow(name="maintenance", flow_run_name="{store}", validate_parameters=False, persist_result=False)
def run_maintenance(
    store: str,
    dry_run: bool = False,
    keep: int | None = None,
    older_than: float = 1.0,
    frames_budget: int | None = None,
    verify: bool = False,
) -> State[Maintenance]:
    """Remove what no version needs, keep the cache of frames within a budget, and verify what is stored.

    Args:
        store: The store: a folder, s3://bucket/key or az://container/key.
        dry_run: Remove nothing, and report what would be removed.
        keep: Number of versions of each object to keep, the newest ones; null: all.
        older_than: Only remove data unused for at least this many days; in an object store for at least an hour.
        frames_budget: Largest size of the cache of frames in bytes; null: no limit.
        verify: Read all versions, and fail if something is not as it was written.
    """
    done = maintain(
        Location.parse(store),
        age=timedelta(days=older_than),
        dry_run=dry_run,
        keep=keep,
        frames_budget=frames_budget,
    )
    rows = [row | {name: plain(row[name]) for name in ("target", "note")} for row in done.rows()]
    create_table_artifact(rows, key=artifact_key(f"maintenance {store}"), description=plain(store))
    if done.warning:
        create_markdown_artifact(
            f"{plain(done.warning)}\n\n{plain(DISK_SPACE_REMEDY)}", key=artifact_key(f"disk {store}")
        )
        emit_event(
            DISK_EVENT,
            resource={"prefect.resource.id": "glint.store", "prefect.resource.name": store},
            payload={"store": store, "warning": done.warning, "remedy": DISK_SPACE_REMEDY},
        )
    verified = verify_store(Location.parse(store)) if verify else None
    if verified is not None and verified.damages:
        damages = [{"damaged": plain(item.message), "what to do": plain(item.remedy)} for item in verified.damages]
        create_table_artifact(damages, key=artifact_key(f"damage {store}"), description=plain(verified.summary))
    if done.failed:
        first = done.failed[0]
        return Failed(message=f"{len(done.failed)} not maintained; {first.target}: {first.note}", data=done)
    if verified is not None and verified.damages:
        worst = verified.damages[0]
        return Failed(message=f"{verified.summary}; {worst.message} -> {worst.remedy}", data=done)
    checked = f"; {verified.summary}" if verified is not None else ""
    return Completed(message=f"{done.summary}{checked}", data=done)
