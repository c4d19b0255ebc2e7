"""The catalogue view on many captures: the server's answer, the first view in a browser, and scrolling.

    python -m tests.benchmarks.review_page [--captures 10000] [--repeats 5]

The server is warm and its rows are made up, as if it had read them from a store; reading an object takes it some
milliseconds, in the background (`--read` measures that on a store of as many objects as are given, each with one
small stage). The first view counts from the request of the page to its first row with its picture's place, in headless
Chromium. The bar: 1 s.
"""

import argparse
import re
import tempfile
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from glint.flows.review.listing import Listing
from glint.flows.review.object_rows import Row, object_rows
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from tests import browser
from tests.flows.review.conftest import serve

STATES = ("failed", "doubtful", "warnings", "done", "done", "done", "new")


def fill(listing: Listing, captures: int) -> None:
    """Put made-up rows into a listing."""
    start = datetime(2026, 1, 1, tzinfo=UTC)
    for number in range(captures):
        state, name = STATES[number % len(STATES)], f"object-{number:05}"
        warnings = (f"warning {number}: the light covers 60% of the hemisphere",) if state == "warnings" else ()
        listing._rows[name] = {
            "front": Row(
                name, "front", state, verdict="good", reason="highlights on 61% of the object", warnings=warnings,
                confident=number % 100 / 100, version="v1",
                date=(start + timedelta(minutes=number)).isoformat(timespec="seconds"),
            )
        }  # fmt: skip


def reading_seconds(objects: int) -> float:
    """Seconds to read the row of an object, the median over a small store."""
    with tempfile.TemporaryDirectory() as folder:
        location, seconds = Location.parse(folder), list[float]()
        for number in range(objects):
            repository = ObjectRepository.open(location, f"object-{number}")
            repository.save("front", "survey", "key", {"mask": np.ones((8, 8), bool)}, {"seconds": 1.0})
            repository.publish(["front"], {})
        for number in range(objects):
            started = time.perf_counter()
            object_rows(location, f"object-{number}")
            seconds.append(time.perf_counter() - started)
        return median(seconds)


def first_view(page: Any, origin: str) -> float:
    """Seconds from the request of the page to its first row."""
    page.goto("about:blank")
    started = time.perf_counter()
    page.goto(origin + "/")
    page.wait_for_selector(".row .name")
    return time.perf_counter() - started


SCROLL = """async () => {
    const scroller = document.querySelector(".scroller");
    const gaps = [];
    let last = performance.now();
    for (let step = 0; step < 200; step += 1) {
        scroller.scrollTop += 240;
        await new Promise(requestAnimationFrame);
        const now = performance.now();
        gaps.push(now - last);
        last = now;
    }
    return gaps;
}"""


def main() -> None:
    """Measure and print."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--captures", type=int, default=10_000)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--read", type=int, default=0)
    options = parser.parse_args()
    if options.read:
        print(f"reading an object: {1000 * reading_seconds(options.read):.1f} ms")
    with tempfile.TemporaryDirectory() as folder:
        served = serve(Path(folder) / "store", None)
        listing = served.app.state.review.listing
        fill(listing, options.captures)
        answers = []
        for _ in range(options.repeats):
            started = time.perf_counter()
            listing._matching([], (), "attention")
            answers.append(time.perf_counter() - started)
        print(f"rows sorted and filtered: {1000 * median(answers):.0f} ms of {options.captures:,}")
        with sync_playwright() as driver:
            running = driver.chromium.launch(executable_path=browser.program(), args=["--no-sandbox"])
            page = running.new_page(viewport={"width": 1280, "height": 800})
            page.goto(served.access.link())
            page.wait_for_url(re.compile(r"/$"))
            views = [first_view(page, served.origin) for _ in range(options.repeats)]
            gaps = sorted(page.evaluate(SCROLL))
            print(f"first view: {median(views):.2f} s (longest {max(views):.2f} s)")
            print(f"scrolling: {median(gaps):.0f} ms a frame, 95th percentile {gaps[int(0.95 * len(gaps))]:.0f} ms")
            running.close()
        served.stop()


if __name__ == "__main__":
    main()
