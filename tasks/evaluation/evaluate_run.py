"""Evaluate all captures and models of a finished run against their ground truth."""

from collections.abc import Callable, Iterable, Sequence
from itertools import groupby

from glint.storage.catalogue.loading import Catalogue
from glint.storage.catalogue.models import MODEL
from glint.storage.errors import InputError
from glint.storage.locations.location import Location
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.references import CaptureReference
from glint.tasks.evaluation.ablation import ablate
from glint.tasks.evaluation.captures import Evaluation, evaluate
from glint.tasks.evaluation.models import ModelEvaluation, evaluate_model
from glint.tasks.evaluation.questions import QuestionsEvaluation, evaluate_questions
from glint.tasks.pipeline import STAGES

Report = Callable[[str, str], None]
"""Callback with a capture's name and a message about it."""


def contexts_of(catalogue: str, store: str, run: str, captures: Iterable[tuple[str, str]]) -> list[CaptureContext]:
    """Open the captures (object id, capture id) of a run; merged models are left out."""
    address = Location.parse(catalogue).uri
    return [
        CaptureReference(address, object_id, capture_id, store, run).context()
        for object_id, capture_id in captures
        if capture_id != MODEL
    ]


def evaluate_captures(
    contexts: Sequence[CaptureContext], report: Report
) -> tuple[list[Evaluation], dict[str, InputError]]:
    """Compare each capture with its true normals; those without are reported and left out.

    Returns: the evaluations, and by capture why its ground truth cannot be used.
    """
    stages, evaluations = tuple(stage.name for stage in STAGES), list[Evaluation]()
    faults = dict[str, InputError]()
    for context in contexts:
        try:
            evaluation = evaluate(context, stages)
        except InputError as error:
            faults[context.name] = error
            continue
        if evaluation is None:
            report(context.name, "no true normals: not evaluated")
        else:
            evaluations.append(evaluation)
    return evaluations, faults


def evaluate_models(
    contexts: Sequence[CaptureContext], catalogue: Catalogue
) -> tuple[list[ModelEvaluation], dict[str, InputError]]:
    """Compare the merged model of each object with its true surface; objects without one are left out.

    So are those of which `contexts` lack a capture that the model is made of. Captures of an object stand next to each
    other.

    Returns: the evaluations, and by OBJECT/model why its true surface cannot be used.
    """
    evaluations, faults = list[ModelEvaluation](), dict[str, InputError]()
    for object_id, captures in groupby(contexts, lambda context: context.object_id):
        try:
            evaluation = evaluate_model(catalogue.object(object_id), list(captures))
        except InputError as error:
            faults[f"{object_id}/{MODEL}"] = error
            continue
        if evaluation is not None:
            evaluations.append(evaluation)
    return evaluations, faults


def ablate_captures(contexts: Sequence[CaptureContext], report: Report) -> dict[str, dict[str, tuple[float, float]]]:
    """Return the errors with each ingredient of the labelling switched off, by capture that has a ground truth."""
    ablations = {}
    for context in contexts:
        report(context.name, "ablation")
        errors = ablate(context)
        if errors is not None:
            ablations[context.name] = errors
    return ablations


def question_captures(contexts: Sequence[CaptureContext], count: int, report: Report) -> list[QuestionsEvaluation]:
    """Ask `count` questions of each capture that has a ground truth, which answers them."""
    evaluations = []
    for context in contexts:
        report(context.name, f"{count} questions")
        evaluation = evaluate_questions(context, count)
        if evaluation is not None:
            evaluations.append(evaluation)
    return evaluations
