"""How long it takes from an answer to the new picture of the normals, by the review page's own interface.

    python -m tests.benchmarks.answers STORE OBJECT/CAPTURE [--answers 10] [--pause 2]

A server of the page in this process; each answer is saved, labelled at once, and its picture fetched, as the page does
it, after the pause in which a person watches the loop of two seconds. It prints how long the first questions take, of
a store that does not have them yet and of one that does, and the median and the 95th percentile of wall and processor
time of an answer, beside the load of the machine. The bar: 1.5 s, and 3 s for the 95th. The marks of the capture are
afterwards as they were.
"""

import argparse
import os
import shutil
import time
from pathlib import Path
from statistics import median
from typing import Any

import requests

from glint.storage.kept_values import KEPT_FOLDER
from glint.tasks.review.questions import _sessions
from tests.flows.review.conftest import serve
from tests.polling import until


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("store", type=Path)
    parser.add_argument("capture")
    parser.add_argument("--answers", type=int, default=10)
    parser.add_argument("--pause", type=float, default=2.0)
    options = parser.parse_args()
    served = serve(options.store, None)
    session = requests.Session()
    session.headers.update(served.session | {"Origin": served.origin})
    path = f"{served.origin}/api/captures/{options.capture}"
    kept = options.store / "objects" / options.capture.split("/")[0] / KEPT_FOLDER
    shutil.rmtree(kept, ignore_errors=True)
    for state in ("computed", "kept in the store"):
        _sessions.clear()
        wall, processor = time.perf_counter(), time.process_time()
        proposed = session.get(f"{path}/questions", timeout=600).json()
        took = time.perf_counter() - wall, time.process_time() - processor
        until(lambda: served.app.state.review.preparation.is_idle)
        print(f"first questions, {state}: {took[0]:.1f} s, processor {took[1]:.1f} s, load {os.getloadavg()[0]:.1f}")
    marks, revision = proposed["marks"], proposed["revision"]
    walls, processors = list[float](), list[float]()
    for number, question in enumerate(proposed["questions"][: options.answers]):
        kind = "false" if number % 2 else "true"
        marks = [*marks, {name: question[name] for name in ("frame", "x", "y")} | {"kind": kind}]
        time.sleep(options.pause)
        wall, processor = time.perf_counter(), time.process_time()
        revision = _saved(session, path, marks, revision)
        session.get(f"{path}/questions/labelling", timeout=600).raise_for_status()
        session.get(f"{path}/questions/normals", timeout=600).raise_for_status()
        walls.append(time.perf_counter() - wall)
        processors.append(time.process_time() - processor)
    _saved(session, path, proposed["marks"], revision)
    for name, seconds in (("wall", walls), ("processor", processors)):
        late = sorted(seconds)[min(len(seconds) - 1, int(0.95 * len(seconds)))]
        print(f"{name}: median {median(seconds):.2f} s, 95th percentile {late:.2f} s of {len(seconds)} answers")
    print(f"load {os.getloadavg()[0]:.1f}")
    served.stop()


def _saved(session: requests.Session, path: str, marks: list[dict[str, Any]], revision: int) -> int:
    body: Any = {"changes": {"marks": marks}, "author": "benchmark", "base_revision": revision}
    answer = session.post(f"{path}/edits", json=body, timeout=600)
    answer.raise_for_status()
    saved = answer.json()["revision"]
    return revision if saved is None else int(saved["number"])


if __name__ == "__main__":
    main()
