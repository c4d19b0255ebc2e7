"""Preparation of the questions about the capture that is looked at, in the background: their view opens at once."""

import threading
from contextlib import suppress

from glint.flows.errors import USER_ERRORS
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.review.questions import prepare


class Preparation:
    """Prepares one capture at a time, next the one that was shown last: a person has left the others."""

    def __init__(self) -> None:
        self._waiting: CaptureContext | None = None
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None

    @property
    def is_idle(self) -> bool:
        """True if everything that was shown is prepared, or cannot be."""
        thread = self._thread  # another thread may set it to None meanwhile
        return thread is None or not thread.is_alive()

    def show(self, context: CaptureContext) -> None:
        """Prepare a capture that a browser has opened; return at once."""
        with self._lock:
            self._waiting = context
            if self.is_idle:
                self._thread = threading.Thread(target=self._work, name="prepare-questions", daemon=True)
                self._thread.start()

    def _work(self) -> None:
        while (context := self._next()) is not None:
            # It has not run yet, or cannot be read: the view says so when it is opened.
            with suppress(*USER_ERRORS):
                prepare(context)

    def _next(self) -> CaptureContext | None:
        with self._lock:
            context, self._waiting = self._waiting, None
            if context is None:
                self._thread = None
            return context
