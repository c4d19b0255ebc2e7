"""A sink for tests of what a run reports."""

from glint.flows.reporting.events import Event


class RecordingSink:
    """A sink that keeps the events."""

    def __init__(self) -> None:
        self.events: list[Event] = []

    def emit(self, event: Event) -> None:
        """Keep an event."""
        self.events.append(event)
