"""What an object's repository no longer needs: results that were replaced, and icechunk's copies of its own index."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import icechunk
import obstore

from glint.storage.locations.location import Location
from glint.storage.versions.snapshots import drop_stale_branches


@dataclass(frozen=True, slots=True)
class Garbage:
    """What a collection removed, or would remove: files or objects, and their bytes."""

    objects: int
    bytes: int

    def __add__(self, other: "Garbage") -> "Garbage":
        """Both together."""
        return Garbage(self.objects + other.objects, self.bytes + other.bytes)


def collect(repository: icechunk.Repository, place: Location, keep: timedelta, dry_run: bool) -> Garbage:
    """Remove what no version and no branch's tip refers to and is older than `keep`."""
    limit = datetime.now(UTC) - keep
    if not dry_run:
        drop_stale_branches(repository, limit)
        repository.expire_snapshots(limit)
    summary = repository.garbage_collect(limit, dry_run=dry_run)
    parts = (summary.chunks_deleted, summary.manifests_deleted, summary.snapshots_deleted)
    objects = sum(parts) + summary.attributes_deleted + summary.transaction_logs_deleted
    copies = _old_copies(place, limit)
    if not dry_run and copies:
        obstore.delete(place.obstore(), list(copies))
    return Garbage(objects + len(copies), summary.bytes_deleted + sum(copies.values()))


def _old_copies(place: Location, limit: datetime) -> dict[str, int]:
    """Bytes by key of the copies that icechunk makes of its index at every commit, the newest left out."""
    listed = [meta for batch in obstore.list(place.obstore(), prefix="overwritten") for meta in batch]
    newest = max((meta["last_modified"] for meta in listed), default=limit)
    return {meta["path"]: meta["size"] for meta in listed if meta["last_modified"] < min(limit, newest)}
