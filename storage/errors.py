"""Errors of Glint: each names the offending value and the remedy, as text that is safe to print."""

import json
import unicodedata

_UNPRINTABLE = frozenset(("Cc", "Cf", "Cs", "Zl", "Zp"))
"""Unicode categories that a terminal obeys instead of showing: control, direction, lone surrogates, line ends."""


def printable(text: str, keep: str = "") -> str:
    r"""Return a text with control characters, marks of writing direction and lone surrogates written as \uXXXX.

    Names and values come from files of other people; a terminal would obey the escape sequences in them.

    keep: characters that are left as they are.
    """
    if text.isprintable():
        return text
    return "".join(
        _escaped(character) if unicodedata.category(character) in _UNPRINTABLE and character not in keep else character
        for character in text
    )


def one_line(error: BaseException, limit: int = 120) -> str:
    """Return the first `limit` characters of an error's text, in one line."""
    return " ".join(str(error).split())[:limit]


def _escaped(character: str) -> str:
    escaped = json.dumps(character)[1:-1]
    return escaped if escaped != character else f"\\u{ord(character):04x}"


class GlintError(Exception):
    """Base of the errors that a user can fix: `message` names the offending value, `remedy` says what to do."""

    def __init__(self, message: str, remedy: str) -> None:
        self.message, self.remedy = printable(message), printable(remedy)
        super().__init__(f"{self.message}: {self.remedy}")

    def __reduce__(self) -> tuple[type["GlintError"], tuple[str, str]]:
        """Return class and arguments for pickling, so that both texts arrive from a worker process."""
        return type(self), (self.message, self.remedy)


class InputError(GlintError):
    """An input (video, image, mask, lights, annotations, truth) or a given address is missing or unusable."""


class StoreError(GlintError):
    """The store cannot be read or written, or its content is not as expected."""


class NotFoundError(StoreError, KeyError):
    """A name that a store, object or version does not have; a KeyError, so that `in` and `get` work as for a dict."""

    def __str__(self) -> str:
        """Return the message without the quotation marks that a KeyError puts around it."""
        return str(self.args[0])


class OutputError(GlintError):
    """The folder of an export cannot be written."""


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
