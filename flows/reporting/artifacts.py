"""Pages and tables that a run puts on the dashboard: a page per capture and model, a table of the catalogue."""

import hashlib
import re
from collections.abc import Sequence
from typing import Any

from prefect.artifacts import (
    create_markdown_artifact,
    create_progress_artifact,
    create_table_artifact,
    update_progress_artifact,
)

from glint.flows.reporting.events import RunProgress, sentence
from glint.flows.reporting.review_links import review_address
from glint.flows.results import CaptureResult, ObjectResult, RunResult
from glint.storage.catalogue.models import MODEL
from glint.tasks.figures.markdown import plain

MAX_ROWS = 500
"""Rows of a run's table, and entries of its list of problems."""


def create_page_artifact(name: str, page: str) -> None:
    """Put the page of a capture or model (OBJECT/..) beside its task run, with a link to the review page."""
    address = review_address("" if name.endswith(f"/{MODEL}") else name)
    link = f"[See and correct its inputs, run it again]({address}) on the page that `glint review` serves."
    create_markdown_artifact(f"{page}\n\n{link}\n", key=artifact_key(name), description=name)


def create_catalogue_artifact(name: str, result: RunResult) -> None:
    """Put the table of a catalogue's captures beside its flow run, and the problems of those that failed."""
    order = {"failed": 0, "done": 1, "up to date": 2}
    table = sorted((row for entry in result.objects for row in _rows(entry)), key=lambda row: order[row["state"]])
    omitted = f", {len(table) - MAX_ROWS:,} more captures not shown" if len(table) > MAX_ROWS else ""
    create_table_artifact(
        table[:MAX_ROWS], key=artifact_key(f"catalogue {name}"), description=plain(f"{name}{omitted}")
    )
    if result.failed:
        create_markdown_artifact(problems_page(result.failed), key=artifact_key(f"problems {name}"))


def show_run_progress(bar: Any, name: str, progress: RunProgress) -> Any:
    """Put the run's progress beside its flow run, or bring it up to date; return the bar to be given next time."""
    percent = 100.0 * progress.done / max(1, progress.total)
    if bar is None:
        return create_progress_artifact(percent, key=artifact_key(f"progress {name}"), description=sentence(progress))
    update_progress_artifact(bar, percent, description=sentence(progress))
    return bar


def problems_page(failed: Sequence[CaptureResult]) -> str:
    """Return a markdown page of failed captures: errors and remedies."""
    lines = [
        f"- **[{plain(item.name)}]({review_address(item.name)})**: {plain(item.error)}: {plain(item.remedy)}"
        for item in failed[:MAX_ROWS]
    ]
    lines += [f"- and {len(failed) - MAX_ROWS:,} more"] * (len(failed) > MAX_ROWS)
    return "\n".join(["# Captures without a result", "", *lines, ""])


def artifact_key(name: str) -> str:
    """Return the key of an artifact: lower-case letters, digits and dashes, different for different captures."""
    key = re.sub(r"[^a-z0-9-]+", "-", name.lower().replace("/", "--")).strip("-")
    if re.fullmatch(r"[a-z0-9]+([- /][a-z0-9]+)*", name):
        return key
    # Other characters became dashes, too: a digest tells them apart.
    return f"{key}-{hashlib.sha256(name.encode()).hexdigest()[:8]}".lstrip("-")


def _rows(result: ObjectResult) -> list[dict[str, Any]]:
    version = result.version.name if result.version is not None else "none"
    return [
        {
            "capture": capture.name,
            "state": capture.outcome,
            "version": version,
            "seconds": round(capture.seconds, 2),
            "frames": capture.count("frames", "frames"),
            "frames with a light": capture.count("lights", "accepted"),
            "observed pixels": capture.count("clusters", "observed pixels"),
            "warnings": len(capture.warnings),
        }
        for capture in result.captures
    ]
