"""Markdown of pages for the dashboard."""

import html
import re
from string import whitespace

from glint.storage.errors import printable


def plain(text: str) -> str:
    """Return any text as one line of markdown that shows it literally."""
    one_line = html.escape(" ".join(printable(text, keep=whitespace).split()), quote=False)
    return re.sub(r"([\\`*_{}\[\]()#+!|~:-])", r"\\\1", one_line)
