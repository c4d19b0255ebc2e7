"""`glint edits`: what people did to the inputs of an object's captures, as a table and as files."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glint.flows.cli.options import Json, Store, chosen_store, print_lines
from glint.flows.cli.output import echo

if TYPE_CHECKING:
    from glint.storage.edits.edits import Edits
    from glint.storage.edits.models import Changes, Revision
    from glint.storage.locations.location import Location

_FILE: dict[str, Any] = {"exists": True, "dir_okay": False}
"""Options that name a file to read."""


def edits(
    name: Annotated[str, typer.Argument(metavar="OBJECT[/CAPTURE]", help="The object, or one of its captures.")],
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Write edits.yaml, masks and marks to a new folder.")
    ] = None,
    take: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Save the edits in a file such as edits.yaml.", **_FILE)
    ] = None,
    mask: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Save this image as the mask of CAPTURE.", **_FILE)
    ] = None,
    markup: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Save these marks as those of CAPTURE.", **_FILE)
    ] = None,
    undo: Annotated[int | None, typer.Option(metavar="N", min=1, help="Undo edit N.")] = None,
    discard: Annotated[bool, typer.Option("--discard", help="Undo all edits of CAPTURE.")] = False,
    author: Annotated[str | None, typer.Option(metavar="NAME", help="Your name (default: the login name).")] = None,
    store: Store = None,
    as_json: Json = False,
) -> None:
    """Show, export, import or undo the changes that people made to the inputs of an object's captures."""
    from glint.storage.edits.edits import Edits
    from glint.storage.edits.files import changes_of_files, take_files, write_files
    from glint.storage.locations.location import Location

    object_id, _, capture = name.partition("/")
    takes = take is not None or mask is not None or markup is not None
    location = Location.parse(chosen_store(store))
    if takes:
        _warn_of_unknown_object(location, object_id)
    opened = Edits.open(location, object_id, create=takes)
    if capture:
        _warn_of_unknown_capture(opened, capture, takes)
    saved = list["Revision | None"]()
    if take is not None:
        saved += take_files(opened, take, _name(author), capture or None, partial(_check_fit, opened))
    if mask is not None or markup is not None:
        changes = changes_of_files(mask, markup)
        _check_fit(opened, _required(capture, name), changes)
        saved.append(opened.save(capture, changes, _name(author), opened.revision))
    if undo is not None:
        _check_edit(opened, undo, capture)
        saved.append(opened.undo(undo, _name(author)))
    if discard:
        saved.append(opened.discard(_required(capture, name), _name(author)))
    saves = takes or undo is not None or discard
    if saves:
        _print_saved(object_id, [revision for revision in saved if revision is not None], as_json)
    if out is not None:
        paths = write_files(opened, [capture] if capture else opened.captures(), out)
        _print_files(paths, as_json)
    elif not saves:
        _print_current(opened, capture, as_json)


def _warn_of_unknown_object(location: "Location", object_id: str) -> None:
    """Point out, on standard error, an object that a store with others does not have so far: it may be misspelt."""
    from glint.storage.versions.repository import object_ids

    known = object_ids(location)
    if known and object_id not in known:
        remedy = f"  -> `glint edits {object_id}/CAPTURE --discard` takes the edit back if the name is wrong"
        echo(f"{location.uri} has no object {object_id!r} yet: it is created\n{remedy}", colour="yellow", err=True)


def _warn_of_unknown_capture(opened: "Edits", capture: str, takes: bool) -> None:
    """Point out, on standard error, a capture that no run and no edit has named so far: it may be misspelt."""
    from glint.storage.versions.repository import ObjectRepository

    known = {*ObjectRepository.open(opened.location, opened.object_id).captures(), *opened.captures()}
    if known and capture not in known:
        message = f"{opened.object_id} has no results of a capture {capture!r} (it has {', '.join(sorted(known))})"
        remedy = "`--discard` takes the edit back if the name is wrong" if takes else "check the name"
        echo(f"{message}\n  -> {remedy}", colour="yellow", err=True)


def _check_fit(opened: "Edits", capture: str, changes: "Changes") -> None:
    """Check that changes lie in the frames of the last run, if there was one.

    Raises:
        InputError: one does not.
    """
    from glint.storage.errors import InputError
    from glint.storage.versions.repository import ObjectRepository
    from glint.tasks.review.capture_inputs import check_fit, frame_count

    records = ObjectRepository.open(opened.location, opened.object_id).records(capture)
    if "survey" not in records:
        return
    width, height = records["survey"][1]["frame_size"]
    try:
        check_fit(changes, (height, width), frame_count(records))
    except InputError as error:
        name = f"{opened.object_id}/{capture}"
        remedy = f"{error.remedy}; if the frames were replaced, run {name} first"
        raise InputError(f"{name}: {error.message}", remedy) from error


def _check_edit(opened: "Edits", number: int, capture: str) -> None:
    """Check that an edit is of the capture that the command line names, if it names one.

    Raises:
        InputError: it is of another.
    """
    from glint.storage.errors import InputError

    edited = next((item.capture for item in opened.history() if item.number == number), capture)
    if capture not in ("", edited):
        message = f"edit {number} is of {opened.object_id}/{edited}, not of {opened.object_id}/{capture}"
        raise InputError(message, f"see `glint history {opened.object_id}` for the numbers of edits")


def _print_saved(object_id: str, saved: "list[Revision]", as_json: bool) -> None:
    if as_json:
        for revision in saved:
            fields = revision.model_dump(mode="json", exclude={"seals"}) | {
                "capture": f"{object_id}/{revision.capture}"
            }
            print_lines([{"kind": "edit", **fields}])
        return
    for revision in saved:
        echo(f"{object_id}/{revision.capture}: edit {revision.number}: {revision.sentence}")
    echo("next: glint run CATALOGUE" if saved else "nothing changes")


def _print_files(paths: list[Path], as_json: bool) -> None:
    """Print the files that were written."""
    for path in paths:
        if as_json:
            print_lines([{"kind": "file", "path": str(path)}])
        else:
            echo(str(path))


def _print_current(opened: "Edits", capture: str, as_json: bool) -> None:
    """Print which fields are edited, by whom, and the notes."""
    from glint.flows.cli.tables import show, table_of
    from glint.storage.errors import DamagedError

    rows, notes, damages = [], [], []
    for name in [capture] if capture else opened.captures():
        try:
            current = opened.current(name)
        except DamagedError as error:
            damages.append(error)
            continue
        for field in current.edited:
            change = current.changes[field]
            moment = change.time.isoformat(timespec="seconds")
            made = {"edit": change.revision, "author": change.author, "time": moment}
            rows.append({"capture": f"{opened.object_id}/{name}", "field": field, **made})
        notes += [{"capture": f"{opened.object_id}/{name}", **note.model_dump(mode="json")} for note in current.notes]
    if as_json:
        print_lines({"kind": "edited", **row} for row in rows)
        print_lines({"kind": "note", **note} for note in notes)
    elif rows or not damages:
        show(table_of(rows, "nothing is edited"))
    for note in [] if as_json else notes:
        echo(f"{note['capture']}: {note['author']}, {note['time'][:16]}: {note['text']}")
    for damage in damages[:-1]:
        echo(f"{damage.message}\n  -> {damage.remedy}", colour="red", err=True)
    if damages:
        raise damages[-1]


def _required(capture: str, name: str) -> str:
    """Return the capture that a command line names.

    Raises:
        InputError: it names none.
    """
    from glint.storage.errors import InputError

    if not capture:
        raise InputError(f"{name} names no capture", f"write {name}/CAPTURE")
    return capture


def _name(author: str | None) -> str:
    """Return the name of --author, else of who is logged in."""
    import getpass

    if author is not None:
        return author
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return "somebody"
