"""What storage refuses, and why: every error names the offending value and the remedy."""


class StorageError(Exception):
    """Base of all errors of this package: `message` names the offending value, `remedy` says what to do about it."""

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(f"{message}: {remedy}")
        self.message = message
        self.remedy = remedy

    def __reduce__(self) -> tuple[type["StorageError"], tuple[str, str]]:
        """Survive the journey back from a worker process with both texts."""
        return type(self), (self.message, self.remedy)


class InputError(StorageError):
    """An input of a capture (video, image, mask, lights, markup, truth) is missing or unusable."""


class StoreError(StorageError):
    """The store cannot be read or written as it must be."""


class StoreUnreachable(StoreError):
    """The store does not answer, or not in time; later it may."""
