"""What the best answers are worth: sheets with wrong labels corrected by the truth, the best ten and all of them.

    python -m tests.benchmarks.best_answers CATALOGUE STORE [--only OBJECT]... [--answers 10]

The captures of CATALOGUE with a truth (or those of OBJECT) were run into STORE. An answer fixes every candidate of its
sheet, more than one highlight reaches on the review page. The best answers are chosen by the error that follows: first
all wrong sheets alone, then, after each choice, the most promising of the rest anew. Squared errors over the observed
region; changes are relative to the labels without answers. A greedy choice by the draft that the review page shows is
no strict bound: it ends where no further sheet lowers the draft's error.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.evaluation.metrics import squared_errors
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.questions.proposals import Question
from glint.tasks.algorithms.sheets.patches import cut_patches
from glint.tasks.algorithms.sheets.sheet_graph import sheet_graph
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.references import CaptureReference, chosen_captures, load_catalogue
from glint.tasks.evaluation.questions import oracle
from glint.tasks.questions.capture_questions import CaptureQuestions

MIN_PIXELS = 3
"""Smallest sheet that a person can be asked about."""
TRIED_AGAIN = 12
"""Sheets whose worth is measured anew after each choice."""


def corrections(questions: CaptureQuestions, labels: np.ndarray, truth: np.ndarray) -> list[Marks]:
    """Return, for each sheet of at least MIN_PIXELS whose label the truth contradicts, marks of all its candidates."""
    normals = np.where(questions.mask[None, :, :, None], questions.clusters.normals, np.nan).astype(np.float32)
    nodes, ties = sheet_graph(normals)
    patches = cut_patches(nodes, ties, labels, inradius_of(questions.mask))
    wrong = []
    for number in range(patches.count):
        chosen = patches.number == number
        at = patches.layer[chosen], patches.row[chosen], patches.column[chosen]
        is_exterior = bool(np.mean(labels[at] > 0) > 0.5)
        is_true = oracle(Question(*at, is_exterior, 0.0, 0.0), normals, truth)
        if is_true is None or is_true == is_exterior or len(at[0]) < MIN_PIXELS:
            continue
        pixels = np.stack(at[1:], axis=-1).astype(np.int32)
        wrong.append(Marks(pixels, normals[at], np.full(len(pixels), int(is_true), np.int8)))
    return wrong


def joined(chosen: Sequence[Marks]) -> Marks | None:
    """Return the marks of several corrections; None without any."""
    if not chosen:
        return None
    columns = zip(*((marks.pixels, marks.half_vectors, marks.kind) for marks in chosen), strict=True)
    return Marks(*(np.concatenate(column) for column in columns))


def best(wrong: Sequence[Marks], count: int, error: Callable[[Sequence[Marks]], float]) -> list[Marks]:
    """Choose at most `count` corrections, one after the other, by the error of the draft that follows."""
    chosen, reached = list[Marks](), error([])
    remaining = list(np.argsort([error([marks]) for marks in wrong]))
    while remaining and len(chosen) < count:
        tried = {number: error([*chosen, wrong[number]]) for number in remaining[:TRIED_AGAIN]}
        ordered = sorted(tried, key=lambda number: tried[number])
        if tried[ordered[0]] >= reached:
            break
        reached = tried[ordered[0]]
        chosen.append(wrong[ordered[0]])
        remaining = ordered[1:] + remaining[TRIED_AGAIN:]
    return chosen


def measure(work: CaptureContext, count: int) -> None:
    """Print what corrections of a capture are worth; nothing without a truth."""
    if work.capture.truth is None:
        return
    questions = CaptureQuestions(work)
    truth = read_truth(work.capture.truth, questions.mask.shape).normals
    assert truth is not None
    observed = questions.mask & (questions.clusters.observations > 0)

    def error(normals: np.ndarray) -> float:
        return squared_errors(normals, truth, observed)

    result = questions.label(None)
    before, wrong = error(result.normals), corrections(questions, result.labels, truth)
    chosen = best(wrong, count, lambda some: error(questions.draft_normals(joined(some))))
    with_best, with_all = (error(questions.label(joined(some)).normals) for some in (chosen, wrong))
    pixels = ", ".join(f"{'true' if marks.kind[0] else 'false'} {len(marks.kind)}" for marks in chosen)
    print(
        f"{work.name}: {before:.4f}; best {len(chosen)} of {len(wrong)} wrong sheets {with_best:.4f}"
        f" ({with_best / before - 1.0:+.0%}), all {with_all:.4f} ({with_all / before - 1.0:+.0%});"
        f" pixels of the best: {pixels}",
        flush=True,
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogue", type=Path)
    parser.add_argument("store")
    parser.add_argument("--only", action="append", default=[])
    parser.add_argument("--answers", type=int, default=10)
    arguments = parser.parse_args()
    address = str(arguments.catalogue)
    for object_id, captures in chosen_captures(load_catalogue(address).objects, arguments.only).items():
        for capture_id in captures:
            reference = CaptureReference(address, object_id, capture_id, arguments.store, "benchmark")
            measure(reference.context(), arguments.answers)


if __name__ == "__main__":
    main()
