"""Photographs of real objects: confidence holds or is withheld, and matte objects are reported."""

from pathlib import Path

import pytest

from tests.benchmarks.real_sets import evaluate
from tests.real_sets import real_sets


@pytest.mark.slow
@pytest.mark.parametrize("name", real_sets(Path()))
def test_confidence_holds_and_matte_objects_are_reported(name: str, shared_data: Path, tmp_path: Path) -> None:
    check(name, shared_data, tmp_path)


@pytest.mark.long
@pytest.mark.usefixtures("smooth_labels")
def test_confidence_in_a_mirror_holds_before_any_body_is_found(shared_data: Path, tmp_path: Path) -> None:
    """The quickest of the sets."""
    check("probe-1", shared_data, tmp_path)


def check(name: str, shared_data: Path, tmp_path: Path) -> None:
    real = real_sets(shared_data)[name]()
    outcome = evaluate(real, tmp_path)
    assert outcome.holds, outcome
    if real.surface == "matte":
        assert outcome.is_reported_matte
    if real.surface == "mirror":
        assert not outcome.is_reported_matte
