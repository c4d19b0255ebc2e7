"""Parse YAML to plain values with line numbers. Nothing in the text is executed or expanded.

Tags, aliases and several documents are refused; scalars follow YAML 1.2's core schema.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
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

from glint.storage.catalogue.diagnostics import Diagnostic, truncate_repr

MAX_BYTES = 64_000_000
"""Size of the largest file that is read."""
MAX_VALUES = 2_000_000
"""Values of a file; a catalogue of 100,000 captures with spheres and regions has fewer, and is read in a minute."""
MAX_DEPTH = 32
"""Levels of nesting that are read."""
_QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"")
_TAB = re.compile(r"\s*\t")
_ESCAPE = re.compile("hex|escape character")
_INTEGER = re.compile(r"[-+]?[0-9]{1,18}")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_CONSTANTS = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
    **dict.fromkeys((".inf", "+.inf", ".Inf", "+.Inf", ".INF", "+.INF"), float("inf")),
    **dict.fromkeys(("-.inf", "-.Inf", "-.INF"), float("-inf")),
}


class LinedDict(dict[str, Any]):
    """A mapping with its own line and those of its keys."""

    __slots__ = ("line", "lines")

    def __init__(self, line: int) -> None:
        super().__init__()
        self.line = line
        self.lines: dict[str, int] = {}


class LinedList(list[Any]):
    """A sequence with its own line and those of its items."""

    __slots__ = ("line", "lines")

    def __init__(self, line: int) -> None:
        super().__init__()
        self.line = line
        self.lines: list[int] = []


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of file: its name, whether a value that was read at least in part belongs to it, and how it begins.

    The content of a file of another kind is not shown: who wrote its address may not be allowed to read it.
    """

    name: str
    includes: Callable[[Any], bool]
    remedy: str


def parse(text: str, file: str, kind: Kind) -> tuple[Any, list[Diagnostic]]:
    """Return the document's value and its errors; the value is None if the text cannot be read to its end."""
    separators = sum(map(text.count, ("\n", ",")))
    if separators > MAX_VALUES:
        message = f"this has more than {separators:,} values"
        return None, [Diagnostic(file, 1, message, f"at most {MAX_VALUES:,} are read: split the file")]
    builder = _Builder(file)
    is_read, cause = False, ""
    try:
        is_read = all(builder.add_event(event) for event in YAML(typ="safe").parse(text))
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        cause = getattr(error, "problem", None) or str(error).splitlines()[0]
        remedy = "fix the line, and check its indentation"
        if mark and _TAB.match(text[mark.index - mark.column : mark.index + 1]):
            cause, remedy = "a tab indents the line", "indent with spaces"
        elif _ESCAPE.search(cause):
            cause = "a backslash between double quotes begins an escape"
            remedy = "write the text between single quotes, or a path with /"
        builder.report(mark.line + 1 if mark else 1, f"this is not YAML: {cause}", remedy)
    except ValueError as error:
        cause = str(error)
        builder.report(1, f"this is not YAML: {cause}", "save the file as UTF-8 text")
    if not kind.includes(builder.root):
        line = builder.diagnostics[-1].line if builder.diagnostics else 1
        shown = f" ({_QUOTED.sub('..', cause)})" if cause else ""
        return None, [Diagnostic(file, line, f"this is not a {kind.name}{shown}", kind.remedy)]
    return builder.root if is_read else None, builder.diagnostics


class _Builder:
    """Builds the value from ruamel's events; `_keys` holds, per open mapping, the key that awaits its value."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.root: Any = None
        self.diagnostics: list[Diagnostic] = []
        self._open: list[LinedDict | LinedList] = []
        self._keys: list[tuple[str, int] | None] = []
        self._documents = 0

    def report(self, line: int, message: str, remedy: str) -> None:
        self.diagnostics.append(Diagnostic(self.file, line, message, remedy))

    def add_event(self, event: Any) -> bool:
        """Add an event's value; return False if parsing must stop."""
        kind = type(event)
        if kind is ScalarEvent:
            self._scalar(event)
        elif kind is MappingStartEvent or kind is SequenceStartEvent:
            return self._start(event, LinedDict if kind is MappingStartEvent else LinedList)
        elif kind is MappingEndEvent or kind is SequenceEndEvent:
            self._open.pop()
            self._keys.pop()
        elif kind is AliasEvent:
            self.report(event.start_mark.line + 1, "aliases (*name) are not supported", "write the value itself")
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
            self.report(line, f"tags ({event.tag}) are not supported", "write the plain value")
        is_key = bool(self._open) and isinstance(self._open[-1], LinedDict) and self._keys[-1] is None
        if is_key:
            self._key(event.value, line)
        else:
            self._add(plain_value(event.value) if event.implicit[0] and not event.style else event.value, line)

    def _key(self, name: str, line: int) -> None:
        if name in self._open[-1]:
            self.report(line, f"{truncate_repr(name)} is given twice", "keep one of them")
        self._keys[-1] = (name, line)

    def _start(self, event: Any, kind: type[LinedDict] | type[LinedList]) -> bool:
        line = event.start_mark.line + 1
        if event.tag is not None:
            self.report(line, f"tags ({event.tag}) are not supported", "write the plain value")
        if len(self._open) >= MAX_DEPTH:
            self.report(line, f"this is nested more than {MAX_DEPTH} levels deep", "a catalogue needs fewer")
            return False
        if self._open and isinstance(self._open[-1], LinedDict) and self._keys[-1] is None:
            self.report(line, "a key must be a plain word", "fix the line")
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
        parent = self._open[-1]
        if isinstance(parent, LinedList):
            parent.append(value)
            parent.lines.append(line)
            return
        key = self._keys[-1]
        assert key is not None
        parent[key[0]] = value
        parent.lines[key[0]] = key[1]
        self._keys[-1] = None


def plain_value(text: str) -> Any:
    """Return the value of a plain (unquoted) scalar."""
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if _INTEGER.fullmatch(text):
        return int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    return text


def line_of(root: Any, location: tuple[int | str, ...]) -> int:
    """Return the line of the value at a path of keys and indices, or of the deepest part of the path that exists."""
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
