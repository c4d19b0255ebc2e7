"""Who set each mark, by a history of two people's changes."""

from pathlib import Path
from typing import Literal

from glint.storage.edits.edits import Edits
from glint.storage.edits.mark_authors import MarkAuthors
from glint.storage.edits.models import Changes
from glint.storage.inputs.markup import AnnotationEntry
from tests.storage.stores import local_store


def mark(frame: int, kind: Literal["true", "false"] = "true") -> AnnotationEntry:
    return AnnotationEntry(frame=frame, x=1.0, y=2.0, kind=kind)


def test_a_mark_has_the_author_of_the_change_that_brought_it(tmp_path: Path) -> None:
    edits = Edits.open(local_store(tmp_path), "glass")

    def save(author: str, *marks: AnnotationEntry) -> int:
        saved = edits.save("front", Changes(marks=marks), author, edits.revision)
        assert saved is not None
        return saved.number

    given, ours, theirs, late = mark(0), mark(1), mark(2, "false"), mark(3)
    known = MarkAuthors("front", [given])
    assert known.at(edits, 0) == {}
    first = save("Ada", given, ours)
    assert known.at(edits, first) == {ours: "Ada"}
    edits.save("front", Changes(verdict="good"), "Cleo", first)
    save("Bob", given, ours, theirs)
    removed = save("Bob", given, theirs)
    undone = edits.undo(removed, "Cleo")
    assert undone is not None
    # Whoever takes a removal back has not set the mark.
    assert known.at(edits, undone.number) == {ours: "Ada", theirs: "Bob"}
    save("Ada", given, theirs)
    last = save("Cleo", given, theirs, ours, late)
    authors = known.at(edits, last)
    assert authors == {ours: "Cleo", theirs: "Bob", late: "Cleo"} == MarkAuthors("front", [given]).at(edits, last)
