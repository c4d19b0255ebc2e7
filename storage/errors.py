"""Errors of Glint: each names the offending value and the remedy."""


class GlintError(Exception):
    """Base of the errors that a user can fix: `message` names the offending value, `remedy` says what to do."""

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(f"{message}: {remedy}")
        self.message = message
        self.remedy = remedy

    def __reduce__(self) -> tuple[type["GlintError"], tuple[str, str]]:
        """Return class and arguments for pickling, so that both texts arrive from a worker process."""
        return type(self), (self.message, self.remedy)


class InputError(GlintError):
    """An input of a capture (video, image, mask, lights, annotations, truth) is missing or unusable."""


class StoreError(GlintError):
    """The store cannot be read or written, or its content is not as expected."""


class StoreUnreachable(StoreError):
    """The store does not answer, or not in time; a later attempt may succeed."""
