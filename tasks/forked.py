"""Load libraries and compiled kernels in the process from which workers are forked, so that all of them share these.

Importing this module does it. It starts no threads, since a fork does not copy them.
"""

import sys
from types import TracebackType

from glint.tasks.engine.imports import collection_paused, import_open3d

_show_error = sys.excepthook


def _show_unless_run_ended(kind: type[BaseException], error: BaseException, traceback: TracebackType | None) -> None:
    """Show an error that ends a worker, unless its run ended first.

    The run's end removes the semaphores that a starting worker was to receive. Nobody waits for that worker.
    """
    frame = traceback
    while frame is not None and frame.tb_next is not None:
        frame = frame.tb_next
    is_semaphore = frame is not None and frame.tb_frame.f_globals.get("__name__") == "multiprocessing.synchronize"
    if not (is_semaphore and isinstance(error, FileNotFoundError)):
        _show_error(kind, error, traceback)


with collection_paused():
    import_open3d()
    from glint.tasks.engine.threads import use_one_thread
    from glint.tasks.warm_up import load_kernels

    use_one_thread()
    load_kernels()
    sys.excepthook = _show_unless_run_ended
