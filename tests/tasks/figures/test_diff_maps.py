"""Maps of what differs between two versions."""

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from glint.storage.errors import OutputError
from glint.tasks.figures.diff_maps import draw_diff_maps
from glint.tasks.version_diff import Difference


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    difference = cast(Difference, SimpleNamespace(depths=np.zeros((4, 4)), angles=np.zeros((4, 4))))
    with pytest.raises(OutputError, match="cannot be written"):
        draw_diff_maps(difference, tmp_path / "file" / "out")
