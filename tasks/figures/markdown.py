"""Markdown of pages for the dashboard."""

import html
import re


def plain(text: str) -> str:
    """Return any text as one line of markdown that shows it literally."""
    one_line = html.escape(" ".join(text.split()), quote=False)
    return re.sub(r"([\\`*_{}\[\]()#+!|~:-])", r"\\\1", one_line)
