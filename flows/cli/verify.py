"""`glint verify`: read a store and compare it with what was written; repair what can be repaired."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glint.flows.cli.options import Json, Store, chosen_store, json_line, print_lines
from glint.flows.cli.output import echo

if TYPE_CHECKING:
    from glint.storage.locations.location import Location
    from glint.storage.maintenance.verify import Damage, StoreVerification

LINE_SHARE = 10
"""Where there is no terminal, a line of progress is printed after each tenth."""


def verify(
    object_id: Annotated[
        str | None, typer.Argument(metavar="[OBJECT]", help="Only this object (default: all).")
    ] = None,
    store: Store = None,
    cache: Annotated[bool, typer.Option("--cache", help="Read the cache of frames too.")] = False,
    repair: Annotated[
        bool,
        typer.Option("--repair", help="Recompute what is damaged, from the catalogues that the versions name."),
    ] = False,
    as_json: Json = False,
) -> None:
    """Read all stored data, and name everything that is damaged."""
    from glint.storage.locations.location import Location
    from glint.storage.maintenance.verify import verify_store

    location, chosen = Location.parse(chosen_store(store)), [object_id] if object_id else []
    with _progress(as_json) as progress:
        outcome = verify_store(location, chosen, cache, progress)
    done = list[str]()
    if repair and outcome.damages:
        done = _repair(location, outcome.damages, as_json)
        with _progress(as_json) as progress:
            outcome = verify_store(location, chosen, cache, progress)
    _print(outcome, done, as_json)
    sys.exit(1 if outcome.damages else 0)


def _repair(location: "Location", damages: "tuple[Damage, ...]", as_json: bool) -> list[str]:
    """Repair the store alone, then run the damaged objects from their catalogues; return what was done."""
    from glint.flows.errors import USER_ERRORS, message_and_remedy
    from glint.flows.pipeline.run import run
    from glint.flows.reporting.console import open_console
    from glint.storage.maintenance.repair import repair
    from glint.tasks.publish import catalogues_of

    done = repair(location, damages)
    damaged = {damage.object_id for damage in damages if damage.object_id and not damage.is_edit}
    for catalogue, object_ids in catalogues_of(location, sorted(damaged)).items():
        named = ", ".join(object_ids)
        if not catalogue:
            done.append(f"{named}: no version that can be read names a catalogue; `glint run CATALOGUE` rebuilds it")
            continue
        try:
            with open_console(as_json) as console:
                summary = run(catalogue, location.uri, console, only=object_ids, rehash=True, adopt=True)
            failed = [f"{capture.name}: {capture.error} -> {capture.remedy}" for capture in summary.result.failed]
            done += failed or [f"{named}: computed again what was damaged, from {catalogue}"]
        except USER_ERRORS as error:
            done.append(f"{named}: {' -> '.join(message_and_remedy(error))}")
    return done


@contextmanager
def _progress(as_json: bool) -> Iterator[Any]:
    """Yield the function that shows (done, total): a bar on a terminal, else a line after each tenth; none as JSON."""
    if as_json:
        yield lambda done, total: None
    elif sys.stderr.isatty():
        from rich.progress import MofNCompleteColumn, Progress

        with Progress(*Progress.get_default_columns(), MofNCompleteColumn(), transient=True) as bar:
            task = bar.add_task("verify", total=None)
            yield lambda done, total: bar.update(task, completed=done, total=total)
    else:

        def line(done: int, total: int) -> None:
            if done * LINE_SHARE // total > (done - 1) * LINE_SHARE // total:
                echo(f"verify: {done:,} of {total:,} parts", err=True)

        yield line


def _print(outcome: "StoreVerification", done: list[str], as_json: bool) -> None:
    if as_json:
        print_lines(json_line("damage", damage, object_id="object") for damage in outcome.damages)
        counts = {name: value for name, value in asdict(outcome).items() if name != "damages"}
        print_lines([{"kind": "verification", **counts, "damaged": len(outcome.damages), "repairs": done}])
        return
    for text in done:
        echo(text)
    for damage in outcome.damages:
        echo(damage.message, colour="red")
        echo(f"  -> {damage.remedy}")
    echo(outcome.summary)
