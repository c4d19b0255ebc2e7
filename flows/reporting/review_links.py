"""Addresses of the review page, which runs print and the dashboard links to, whether it is served or not."""

import os
from urllib.parse import quote

REVIEW_PORT = 4300
"""Port that `glint review` tries first, so that an address that was bookmarked stays good from day to day."""


def review_address(name: str = "") -> str:
    """Return the address of the review page, of the inputs of a capture where `name` is its OBJECT/CAPTURE.

    The page lies at $GLINT_REVIEW_ORIGIN, else at the port of 127.0.0.1 that `glint review` tries first.
    """
    origin = os.environ.get("GLINT_REVIEW_ORIGIN") or f"http://127.0.0.1:{REVIEW_PORT}"
    return f"{origin.rstrip('/')}/#/{quote(name)}{'/inputs' if name else ''}"
