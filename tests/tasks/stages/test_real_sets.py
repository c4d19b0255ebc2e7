"""Photographs of real objects: confidence holds or is withheld, and matte objects are reported."""

from pathlib import Path

import pytest

from tests.benchmarks.real_sets import evaluate
from tests.real_sets import real_sets

QUICK = ("probe-1",)
"""A mirror; the other sets take minutes."""
SETS = [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in real_sets(Path())]


@pytest.mark.long
@pytest.mark.parametrize("name", SETS)
def test_confidence_holds_and_matte_objects_are_reported(name: str, shared_data: Path, tmp_path: Path) -> None:
    real = real_sets(shared_data)[name]()
    outcome = evaluate(real, tmp_path)
    assert outcome.holds, outcome
    if real.surface == "matte":
        assert outcome.is_reported_matte
    if real.surface == "mirror":
        assert not outcome.is_reported_matte
