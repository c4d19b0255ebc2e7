"""One HTML file that shows an object: viewer, arrays and photographs in it, so that a browser needs nothing else.

Its content security policy allows no request, and no script but the viewer's, which it names by its digest.
"""

import base64
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from jinja2 import Environment, StrictUndefined, Template
from markupsafe import Markup

from glint.storage.export.page.bundle import VIEWER, bundled
from glint.storage.export.page.capture_data import CaptureData
from glint.storage.export.page.figures import figures

MAX_PAGE_BYTES = 15_000_000
"""Size of a page: what mail and content management systems still take."""
TEXT_BYTES = 1_500_000
"""Room for the viewer, the figures and the records in it."""
MAX_DATA_BYTES = (MAX_PAGE_BYTES - TEXT_BYTES) * 3 // 4
"""Bytes of packed parts, which base64 makes larger by a third."""


@dataclass(frozen=True, slots=True)
class PageContent:
    """Content of a page.

    title; version: name and time; reports: one for each capture (`capture_report`), in the order of `captures`; model:
    the merged mesh, None without; model_figures: quantity and value; still, coverage: PNG files of pictures without a
    viewer.
    """

    title: str
    version: Mapping[str, Any]
    reports: Sequence[Mapping[str, Any]]
    captures: Sequence[CaptureData]
    catalogue: str | None = None
    model: CaptureData | None = None
    model_figures: Sequence[tuple[str, str]] = field(default_factory=tuple)
    still: bytes | None = None
    coverage: bytes | None = None


def page(content: PageContent) -> str:
    """Return the HTML of a page; all texts are escaped."""
    sources = {f"{number}/": data for number, data in enumerate(content.captures)}
    if content.model is not None:
        sources["model/"] = content.model
    parts = [
        (prefix + name, Markup(base64.b64encode(part.data).decode()))
        for prefix, data in sources.items()
        for name, part in data.parts.items()
    ]
    facts = {
        "captures": [data.facts for data in content.captures],
        "model": None if content.model is None else content.model.facts,
    }
    script, style = _in_element(bundled("export_page.js")), _in_element(_style())
    policy = (
        f"default-src 'none'; script-src '{_digest(script)}'; style-src '{_digest(style)}'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )
    return _template().render(
        title=content.title,
        version=content.version,
        catalogue=content.catalogue,
        reports=content.reports,
        figures=figures,
        model=content.model_figures,
        still=_data_address(content.still),
        coverage=_data_address(content.coverage),
        facts=json_in_element(facts),
        parts=parts,
        policy=Markup(policy),
        script=script,
        style=style,
    )


def json_in_element(content: Any) -> Markup:
    """Return JSON that no parser of HTML takes for the end of its element: `<` is written as an escape."""
    return Markup(json.dumps(content, allow_nan=False, ensure_ascii=True).replace("<", "\\u003c"))


def _in_element(text: str) -> Markup:
    """Return the text of a script or style element.

    Raises:
        ValueError: it would end its element.
    """
    if any(mark in text.lower() for mark in ("</script", "</style", "<!--", "<script")):
        raise ValueError("the viewer's modules hold what would end their element")
    return Markup(text)


def _digest(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def _data_address(png: bytes | None) -> str:
    return "" if png is None else f"data:image/png;base64,{base64.b64encode(png).decode()}"


@cache
def _style() -> str:
    return "".join((VIEWER / name).read_text(encoding="utf-8") for name in ("viewer.css", "page.css"))


@cache
def _template() -> Template:
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string((VIEWER / "page.html").read_text(encoding="utf-8"))
