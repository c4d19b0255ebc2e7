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


class DamagedError(StoreError):
    """Stored bytes are not those that were written."""


def damaged(place: str, problem: str, object_id: str) -> DamagedError:
    """Return the error of a damaged place in the store, how that shows, and what to do.

    place: object, and as far as they are known version, capture, stage and array.
    """
    remedy = f"`glint verify {object_id} --repair` rebuilds what the catalogue can rebuild; else restore a backup"
    return DamagedError(f"{place} is damaged ({problem})", remedy)
