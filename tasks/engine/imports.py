"""Imports of large libraries, at the cost of what they need to run: without looking for garbage, without plots."""

import gc
import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType


@contextmanager
def collection_paused() -> Iterator[None]:
    """Pause Python's cyclic garbage collector during imports, and exempt all that then exists from later collections.

    Modules keep nearly everything that their import creates. To look through it again and again takes a tenth to a
    fifth of the time of an import, and in a forked process it copies the memory that both processes share.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def import_open3d() -> None:
    """Import Open3D without its plots in a browser, for which it would import Dash, Plotly and IPython.

    They are more than half of its import. Whatever imports Open3D afterwards gets it like this.
    """
    plots = ModuleType("open3d.visualization.draw_plotly")
    # Open3D takes functions of this module into its own.
    plots.__dict__["__getattr__"] = lambda name: None
    sys.modules.setdefault(plots.__name__, plots)
    importlib.import_module("open3d")
