"""Labels without the search for bodies and flat faces, nine tenths of their time, for tests of what is around them."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import pytest

from glint.tasks.algorithms.labelling.weights import LabellingOptions
from glint.tasks.questions import capture_questions
from glint.tasks.stages import labels


@contextmanager
def smooth_labels() -> Iterator[None]:
    """Label by the smooth field of the silhouette alone; keys of the results are those of whole labels."""
    usual = labels.labelling_options

    def without_bodies(*arguments: Any) -> LabellingOptions:
        return replace(usual(*arguments), symmetry=False, flat_faces=False)

    with pytest.MonkeyPatch.context() as patch:
        for module in (labels, capture_questions):
            patch.setattr(module, "labelling_options", without_bodies)
        yield
