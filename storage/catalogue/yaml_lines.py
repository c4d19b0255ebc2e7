"""YAML as plain values that remember their lines. Nothing in the text is ever executed or expanded.

Tags, aliases and several documents are refused; scalars are those of YAML 1.2's core schema.
"""

import re
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)

from glint.storage.catalogue.diagnostics import Problem, quoted

MAX_BYTES = 64_000_000
MAX_DEPTH = 32
_INTEGER = re.compile(r"[-+]?[0-9]{1,18}")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_SPECIAL = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
    **dict.fromkeys((".inf", "+.inf", ".Inf", "+.Inf", ".INF", "+.INF"), float("inf")),
    **dict.fromkeys(("-.inf", "-.Inf", "-.INF"), float("-inf")),
}


class LinedDict(dict[str, Any]):
    """A mapping that knows its own line and those of its keys."""

    __slots__ = ("line", "lines")

    def __init__(self, line: int) -> None:
        super().__init__()
        self.line = line
        self.lines: dict[str, int] = {}


class LinedList(list[Any]):
    """A sequence that knows its own line and those of its items."""

    __slots__ = ("line", "lines")

    def __init__(self, line: int) -> None:
        super().__init__()
        self.line = line
        self.lines: list[int] = []


def parse(text: str, file: str) -> tuple[Any, list[Problem]]:
    """The document's value, and what is wrong with it; the value is None if it cannot be read to its end."""
    builder = _Builder(file)
    try:
        for event in YAML(typ="safe").parse(text):
            if not builder.take(event):
                return None, builder.problems
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        what = getattr(error, "problem", None) or str(error).splitlines()[0]
        builder.report(mark.line + 1 if mark else 1, f"this is not YAML: {what}", "mend the line, mind the indentation")
        return None, builder.problems
    except ValueError as error:
        builder.report(1, f"this is not YAML: {error}", "save the file as UTF-8 text")
        return None, builder.problems
    return builder.root, builder.problems


class _Builder:
    def __init__(self, file: str) -> None:
        self.file = file
        self.root: Any = None
        self.problems: list[Problem] = []
        self._open: list[LinedDict | LinedList] = []
        self._keys: list[tuple[str, int] | None] = []
        self._documents = 0

    def report(self, line: int, message: str, remedy: str) -> None:
        self.problems.append(Problem(self.file, line, message, remedy))

    def take(self, event: Any) -> bool:
        """Add what the event says; False if reading on makes no sense."""
        kind = type(event)
        if kind is ScalarEvent:
            self._scalar(event)
        elif kind is MappingStartEvent or kind is SequenceStartEvent:
            return self._start(event, LinedDict if kind is MappingStartEvent else LinedList)
        elif kind is MappingEndEvent or kind is SequenceEndEvent:
            self._open.pop()
            self._keys.pop()
        elif kind is AliasEvent:
            self.report(event.start_mark.line + 1, "aliases (*name) are not read", "write the value out")
            return False
        elif kind is DocumentStartEvent:
            self._documents += 1
            if self._documents > 1:
                self.report(event.start_mark.line + 1, "a second document begins", "keep one document per file")
                return False
        return True

    def _scalar(self, event: Any) -> None:
        line = event.start_mark.line + 1
        if event.tag is not None and event.tag != "!":
            self.report(line, f"tags ({event.tag}) are not read", "write the plain value")
        awaits_key = bool(self._open) and isinstance(self._open[-1], LinedDict) and self._keys[-1] is None
        if awaits_key:
            self._key(event.value, line)
        else:
            self._add(plain_value(event.value) if event.implicit[0] and not event.style else event.value, line)

    def _key(self, name: str, line: int) -> None:
        if name in self._open[-1]:
            self.report(line, f"{quoted(name)} is given twice", "keep one of them")
        self._keys[-1] = (name, line)

    def _start(self, event: Any, kind: type[LinedDict] | type[LinedList]) -> bool:
        line = event.start_mark.line + 1
        if event.tag is not None:
            self.report(line, f"tags ({event.tag}) are not read", "write the plain value")
        if len(self._open) >= MAX_DEPTH:
            self.report(line, f"this is nested more than {MAX_DEPTH} levels deep", "a catalogue needs fewer")
            return False
        if self._open and isinstance(self._open[-1], LinedDict) and self._keys[-1] is None:
            self.report(line, "a key must be a plain word", "mend the line")
            return False
        value = kind(line)
        self._add(value, line)
        self._open.append(value)
        self._keys.append(None)
        return True

    def _add(self, value: Any, line: int) -> None:
        if not self._open:
            self.root = value
            return
        top = self._open[-1]
        if isinstance(top, LinedList):
            top.append(value)
            top.lines.append(line)
            return
        key = self._keys[-1]
        assert key is not None
        top[key[0]] = value
        top.lines[key[0]] = key[1]
        self._keys[-1] = None


def plain_value(text: str) -> Any:
    """A plain scalar's value."""
    if text in _SPECIAL:
        return _SPECIAL[text]
    if _INTEGER.fullmatch(text):
        return int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    return text


def line_of(root: Any, location: tuple[int | str, ...]) -> int:
    """Line of the value at a path of keys and indices, or of the deepest part of the path that is there."""
    line = getattr(root, "line", 1)
    for step in location:
        if isinstance(root, LinedDict) and step in root:
            line = root.lines[str(step)]
        elif isinstance(root, LinedList) and isinstance(step, int) and step < len(root):
            line = root.lines[step]
        else:
            return line
        root = root[step]
    return line
