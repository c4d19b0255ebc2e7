"""Photographs of real objects: confidence holds or is withheld, and matte objects are reported."""

from pathlib import Path

import pytest

from tests.benchmarks.real_sets import evaluate
from tests.real_sets import real_sets

NAMES = tuple(real_sets(Path()))


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_confidence_holds_and_matte_objects_are_reported(name: str, shared_data: Path, tmp_path: Path) -> None:
    real = real_sets(shared_data)[name]()
    outcome = evaluate(real, tmp_path)
    assert outcome.holds, outcome
    if real.surface == "matte":
        assert outcome.is_reported_matte
    if real.surface == "mirror":
        assert not outcome.is_reported_matte
