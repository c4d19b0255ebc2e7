"""Warnings of stages: their order, and what is stored of them."""

import json

from glint.tasks.engine.stage_warning import StageWarning, by_cost


def test_a_warning_survives_json() -> None:
    warning = StageWarning("the sphere at (3, 4) is too small; correct it", "sphere", 2.5)
    assert StageWarning.from_json(json.loads(json.dumps(warning.to_json()))) == warning


def test_the_dearest_warning_comes_first_and_equals_keep_their_order() -> None:
    warnings = [StageWarning("a", "video"), StageWarning("b", "sphere", 7.0), StageWarning("c", "light")]
    assert [str(warning) for warning in by_cost(warnings)] == ["b", "a", "c"]


def test_warnings_of_one_cause_are_one_line_with_the_highest_cost() -> None:
    warnings = [
        StageWarning("a", "sphere", 1.0),
        StageWarning("b", "mask", 2.0),
        StageWarning("c", "sphere", 3.0),
        StageWarning("c", "sphere", 3.0),
    ]
    assert by_cost(warnings) == [StageWarning("c; a", "sphere", 3.0), StageWarning("b", "mask", 2.0)]


def test_a_remedy_that_several_messages_end_with_is_said_once() -> None:
    texts = ("too large by 6 pixels: edges lie inside; correct it", "ragged; correct it", "cut")
    warnings = [StageWarning(text, "mask", 3.0 - number) for number, text in enumerate(texts)]
    (joined,) = by_cost(warnings)
    assert joined.message == "too large by 6 pixels: edges lie inside; ragged; correct it; cut"
