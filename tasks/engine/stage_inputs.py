"""What a stage may read: the parameters, results, catalogue keys and files of its declaration, and nothing else.

A stage's key covers what the stage declares. Anything else that it read could change without the stage being computed
again, so reading it is an error.
"""

from collections.abc import Collection
from typing import Any, Protocol

from glint.storage.locations.location import Location
from glint.storage.versions.stage_results import StageResult
from glint.tasks.engine.capture_context import CaptureContext


class UndeclaredRead(LookupError):
    """A stage reads what it does not declare: an error of its declaration in tasks/pipeline.py."""


class CaptureResults(Protocol):
    """Where results of a capture's stages are loaded from: a stage's inputs, or the capture's whole context."""

    @property
    def location(self) -> Location:
        """The store."""

    def load(self, stage: str) -> StageResult:
        """Return what a stage saved."""

    def file(self, key: str) -> str | None:
        """Return the address that the catalogue gives under a key, None where it gives none."""

    def digest(self, key: str) -> str | None:
        """Return the content digest of the file or files under a key, None where the catalogue gives none."""

    def check_unchanged(self, keys: Collection[str]) -> None:
        """Check that the files under these keys still have the digests that were taken."""


class Declaration(Protocol):
    """What a stage declares to read, see `Stage`."""

    @property
    def name(self) -> str:
        """The stage's name."""

    @property
    def reads(self) -> tuple[str, ...]:
        """Stages whose results it loads."""

    @property
    def catalogue_keys(self) -> tuple[str, ...]:
        """Keys of the capture in the catalogue that it reads."""

    @property
    def files(self) -> tuple[str, ...]:
        """Keys of the capture that name files whose content it reads."""


class StageInputs:
    """The declared inputs of one stage of one capture. Each result is opened once."""

    def __init__(self, context: CaptureContext, stage: Declaration) -> None:
        self._context, self._stage = context, stage
        self._results: dict[str, StageResult] = {}

    @property
    def location(self) -> Location:
        """The store."""
        return self._context.location

    @property
    def parameters(self) -> Any:
        """The stage's own parameters."""
        return getattr(self._context.parameters, self._stage.name)

    def parameters_of(self, stage: str) -> Any:
        """Return the parameters of a stage that this one reads, whose key covers them.

        Raises:
            UndeclaredRead: the stage is not declared.
        """
        self._check(stage, self._stage.reads, "parameters")
        return getattr(self._context.parameters, stage)

    def load(self, stage: str) -> StageResult:
        """Return what an earlier stage saved.

        Raises:
            UndeclaredRead: the stage is not declared; StoreError: it has saved nothing.
        """
        self._check(stage, self._stage.reads, "result")
        if stage not in self._results:
            self._results[stage] = self._context.load(stage)
        return self._results[stage]

    def field(self, key: str) -> Any:
        """Return what the catalogue says of the capture under a key.

        Raises:
            UndeclaredRead: the key is not declared.
        """
        self._check(key, self._stage.catalogue_keys, "catalogue key")
        return getattr(self._context.capture, key)

    def file(self, key: str) -> str | None:
        """Return the address of a file, None where the catalogue gives none.

        Whoever reads the result of `frames` may read the video as well: its frames are a cache, filled again from it.

        Raises:
            UndeclaredRead: the file is not declared.
        """
        self._check_file(key)
        return self._context.file(key)

    def digest(self, key: str) -> str | None:
        """Return the content digest of a file, None where the catalogue gives none.

        Raises:
            UndeclaredRead: the file is not declared.
        """
        self._check_file(key)
        return self._context.digest(key)

    def check_unchanged(self, keys: Collection[str]) -> None:
        """Check that the files under these keys still have the digests that were taken.

        Raises:
            UndeclaredRead: one is not declared; InputError: one is not the same.
        """
        for key in keys:
            self._check_file(key)
        self._context.check_unchanged(keys)

    def _check_file(self, key: str) -> None:
        if not (key == "frames" and "frames" in self._stage.reads):
            self._check(key, self._stage.files, "file")

    def _check(self, name: str, declared: tuple[str, ...], kind: str) -> None:
        if name not in declared:
            raise UndeclaredRead(
                f"the stage {self._stage.name} reads the {kind} {name!r}, which its declaration does not name"
                f" (it names {', '.join(declared) or 'none'})"
            )
