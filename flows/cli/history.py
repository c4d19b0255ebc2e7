"""`glint history` and `glint rollback`: an object's versions."""

from typing import Annotated, Any

import typer

from glint.flows.cli.options import Json, ObjectId, Store, chosen_store, print_lines
from glint.flows.cli.output import echo


def history(object_id: ObjectId, store: Store = None, as_json: Json = False) -> None:
    """List the versions of an object and the edits of its inputs, oldest first."""
    from glint.flows.cli.tables import history_rows, show, table_of

    rows = history_rows(chosen_store(store), object_id)
    if as_json:
        print_lines(_json(object_id, row) for row in rows)
    else:
        show(table_of(rows, "no versions and no edits yet"))


def _json(object_id: str, row: dict[str, Any]) -> dict[str, Any]:
    """Return a version or an edit as a JSON line, which names captures as other commands do."""
    captures = [f"{object_id}/{capture}" for capture in row["captures"].split(", ") if capture]
    kind, _, number = row["version"].rpartition(" ")
    named = {"kind": kind, "edit": int(number)} if kind else {"kind": "version", "version": row["version"]}
    values = {name: value for name, value in row.items() if name not in ("version", "captures")}
    return {**named, "object": object_id, "captures": captures, **values}


def rollback(
    object_id: ObjectId,
    version: Annotated[str, typer.Argument(metavar="VERSION", help="The version to restore: v1, v2, ..")],
    store: Store = None,
    as_json: Json = False,
) -> None:
    """Publish the content of an old version as the newest one; all versions are kept."""
    from glint.storage.locations.location import Location
    from glint.storage.versions.repository import ObjectRepository

    repository = ObjectRepository.open(Location.parse(chosen_store(store)), object_id, create=False)
    newest = repository.rollback(version)
    if as_json:
        published = {"object": object_id, "version": newest.name, "content": version, "created": newest.created}
        print_lines([{"kind": "rollback", **published}])
    elif newest.created:
        echo(f"{object_id}: published {newest.name} with the content of {version}")
    else:
        echo(f"{object_id}: nothing changes: {newest.name} is the newest version and has this content already")
