"""Edits: saved, merged, undone, kept for good; two writers, a killed one, damage, hostile values."""

import base64
import json
import multiprocessing
import os
import pickle
import random
import signal
import threading
import time
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from glint.storage.edits.edits import Edits
from glint.storage.edits.merging import ConflictError
from glint.storage.edits.models import MAX_LINE_CHARACTERS, CaptureEdits, Changes, mask_png
from glint.storage.errors import DamagedError, InputError, StoreError
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from tests.polling import has_grown, until
from tests.storage.edits.sample_edits import MARKS, SPHERES, VALUES, damage_a_chunk, drawn_mask
from tests.storage.stores import MemoryLocation, local_store, save_capture

SPAWN = multiprocessing.get_context("spawn")


@pytest.fixture
def location(tmp_path: Path) -> Location:
    return local_store(tmp_path / "store")


@pytest.fixture
def edits(location: Location) -> Edits:
    return Edits.open(location, "duck")


def test_nothing_is_edited_at_first(edits: Edits, location: Location) -> None:
    assert (edits.revision, edits.captures(), edits.history()) == (0, [], [])
    assert edits.current("front") == CaptureEdits(capture="front", revision=0)
    assert edits.current("front").edited == ()
    with pytest.raises(StoreError, match="no object goose"):
        Edits.open(location, "goose", create=False)


def test_everything_is_read_back_as_it_was_saved(edits: Edits, location: Location) -> None:
    changes = Changes.model_validate(VALUES | {"mask": drawn_mask(), "note": "the rim\nwas cut"}, strict=False)
    saved = edits.save("front", changes, "Ann", 0)
    assert saved is not None and (saved.number, saved.author, saved.capture) == (1, "Ann", "front")
    assert set(saved.fields) == {*VALUES, "mask", "note"}
    current = Edits.open(location, "duck", create=False).current("front")
    assert {name: getattr(current, name) for name in VALUES} == {name: getattr(changes, name) for name in VALUES}
    assert current.mask is not None and current.mask.dtype == bool
    np.testing.assert_array_equal(current.mask, drawn_mask())
    assert [(note.author, note.text, note.time) for note in current.notes] == [("Ann", "the rim\nwas cut", saved.time)]
    assert set(current.changes) == {*VALUES, "mask"}, "a note is no field"
    assert {change.author for change in current.changes.values()} == {"Ann"}
    assert edits.current("back").edited == ()
    assert edits.captures() == ["front"]


def test_a_sentence_says_what_changed(edits: Edits) -> None:
    def sentence(**changes: Any) -> str:
        saved = edits.save("front", Changes(**changes), "Ann", edits.revision)
        assert saved is not None
        return saved.sentence

    moved = [SPHERES[0] | {"x": 44.0, "radius": 12.0}]
    assert sentence(spheres=SPHERES) == "spheres: 1 drawn"
    assert sentence(spheres=moved) == "spheres: 1 by (+3.5, +0.0) pixels, radius -0.2"
    assert sentence(spheres=[moved[0] | {"diameter_mm": 30.0}]) == "spheres: 1 with a diameter of 30 mm"
    smaller = [moved[0] | {"radius": 11.0, "diameter_mm": None}]
    assert sentence(spheres=smaller) == "spheres: 1 by (+0.0, +0.0) pixels, radius -1.0, without a diameter"
    assert sentence(mask=drawn_mask()) == "mask: 400 pixels"
    assert sentence(mask=drawn_mask(45)) == "mask: 100 pixels added, 0 removed"
    assert sentence(marks=MARKS, verdict="good") == "marks: 1 true, 1 false; verdict: good"
    assert sentence(camera=VALUES["camera"]) == "camera: focal length 900 pixels"
    assert sentence(mask=None) == "mask as in the catalogue again"
    assert len(sentence(note="long " * 500)) == MAX_LINE_CHARACTERS
    saved = edits.save("front", Changes(verdict="usable"), "Ann", edits.revision, "I looked at it again")
    assert saved is not None and saved.sentence == "I looked at it again"


def test_what_changes_nothing_is_no_revision(edits: Edits) -> None:
    assert edits.save("front", Changes(mask=None), "Ann", 0) is None
    assert edits.save("front", Changes(mask=drawn_mask()), "Ann", 0) is not None
    assert edits.save("front", Changes(mask=drawn_mask()), "Bob", 0) is None, "others painted the same"
    assert edits.revision == 1


def test_changes_of_different_fields_are_merged(edits: Edits) -> None:
    edits.save("front", Changes(pixel_size=0.5), "Ann", 0)
    edits.save("front", Changes(verdict="good", note="fine"), "Bob", 0)
    edits.save("back", Changes(verdict="record again"), "Bob", 0)
    current = edits.current("front")
    assert (current.pixel_size, current.verdict, current.revision) == (0.5, "good", 3)


def test_the_same_field_changed_meanwhile_is_a_conflict(edits: Edits) -> None:
    first = edits.save("front", Changes(mask=drawn_mask(), pixel_size=0.5), "Ann", 0)
    assert first is not None
    with pytest.raises(ConflictError, match=r"duck/front: Ann changed mask at .* UTC \(edit 1\)") as caught:
        edits.save("front", Changes(mask=drawn_mask(50), verdict="good", note="mine"), "Bob", 0)
    (conflict,) = pickle.loads(pickle.dumps(caught.value)).conflicts
    assert (conflict.field, conflict.author, conflict.time) == ("mask", "Ann", first.time)
    current = edits.current("front")
    assert (current.verdict, current.notes, edits.revision) == (None, (), 1), "nothing of it was saved"
    assert edits.save("front", Changes(mask=drawn_mask(50)), "Bob", 1) is not None, "knowing of it, it counts"
    with pytest.raises(ConflictError, match="Bob changed mask"):
        edits.save("front", Changes(mask=None), "Ann", 1)


def test_undo_gives_the_earlier_values_back(edits: Edits) -> None:
    edits.save("front", Changes(pixel_size=0.5), "Ann", 0)
    edits.save("front", Changes(mask=drawn_mask(), pixel_size=0.75, note="kept"), "Ann", 1)
    edits.save("front", Changes(verdict="good"), "Bob", 2)
    undone = edits.undo(2, "Cid")
    assert undone is not None and (undone.number, undone.undoes, undone.author) == (4, 2, "Cid")
    current = edits.current("front")
    assert (current.mask, current.pixel_size, current.verdict) == (None, 0.5, "good")
    assert [note.text for note in current.notes] == ["kept"]
    assert edits.undo(2, "Cid") is None, "it is undone already"
    edits.undo(4, "Cid")
    assert edits.current("front").pixel_size == 0.75
    np.testing.assert_array_equal(edits.current("front").mask, drawn_mask())
    edits.save("front", Changes(pixel_size=1.0), "Bob", 5)
    with pytest.raises(ConflictError, match="Bob changed pixel_size"):
        edits.undo(2, "Ann")
    with pytest.raises(StoreError, match="duck has edits 1 to 6, not 9"):
        edits.undo(9, "Ann")
    assert edits.current("front", 2).pixel_size == 0.75
    assert edits.current("front", 0).edited == ()


def test_undo_goes_back_step_by_step(edits: Edits) -> None:
    for revision, size in enumerate((0.1, 0.2, 0.3)):
        edits.save("front", Changes(pixel_size=size), "Ann" if size != 0.2 else "Bob", revision)
    edits.save("front", Changes(note="a note is not undone"), "Ann", 3)
    states = []
    while (number := edits.next_undo("front")) is not None:
        edits.undo(number, "Cid")
        states.append((number, edits.current("front").pixel_size))
    assert states == [(3, 0.2), (2, 0.1), (1, None)]
    edits.undo(edits.revision, "Cid")
    assert edits.current("front").pixel_size == 0.1
    assert edits.next_undo("front") == 1, "an undone undo brings its revision back"


def test_the_history_names_all(edits: Edits) -> None:
    edits.save("front", Changes(pixel_size=0.1), "Ann", 0)
    edits.save("back", Changes(pixel_size=0.2), "Bob", 1)
    edits.undo(1, "Bob")
    assert [(item.number, item.capture, item.author, item.undoes) for item in edits.history()] == [
        (1, "front", "Ann", None),
        (2, "back", "Bob", None),
        (3, "front", "Bob", 1),
    ]
    assert [item.number for item in edits.history("front")] == [1, 3]


def test_edits_and_results_leave_each_other_alone(edits: Edits, location: Location) -> None:
    repository = ObjectRepository.open(location, "duck")
    save_capture(repository, "front", "k1")
    edits.save("front", Changes(mask=drawn_mask()), "Ann", 0)
    version = repository.publish(["front"], {})
    edits.save("front", Changes(verdict="good"), "Ann", 1)
    assert "edits" not in repository.contents()["front"]
    assert list(version.stages) == repository.captures() == ["front"]
    assert [item.name for item in repository.history()] == ["v1"]
    repository.rollback("v1")
    assert edits.current("front").edited == ("mask", "verdict")


def test_garbage_collection_keeps_every_edit(edits: Edits, location: Location) -> None:
    repository = ObjectRepository.open(location, "duck")
    for number in range(5):
        edits.save("front", Changes(mask=drawn_mask(30 + number), note=f"note {number}"), "Ann", number)
        save_capture(repository, "front", f"k{number}", number)
    repository.publish(["front"], {})
    assert repository.garbage_collect(min_age=timedelta(seconds=-10)).objects > 0
    fresh = Edits.open(location, "duck")
    for number in range(5):
        mask = fresh.current("front", number + 1).mask
        np.testing.assert_array_equal(mask, drawn_mask(30 + number))
    assert [item.number for item in fresh.history()] == [1, 2, 3, 4, 5]
    fresh.undo(5, "Ann")
    assert fresh.revision == 6


def test_a_writer_that_died_before_the_tag_has_saved(
    edits: Edits, location: Location, monkeypatch: pytest.MonkeyPatch
) -> None:
    edits.save("front", Changes(pixel_size=0.1), "Ann", 0)
    with monkeypatch.context() as patch:
        patch.setattr("glint.storage.edits.records.tag", lambda *_: None)
        edits.save("front", Changes(pixel_size=0.2), "Ann", 1)
    index = ObjectRepository.open(location, "duck").index
    assert set(index.list_tags()) == {"e1"}
    assert [item.number for item in edits.history()] == [1, 2]
    edits.save("front", Changes(pixel_size=0.3), "Ann", 2)
    assert set(index.list_tags()) == {"e1", "e2", "e3"}
    assert edits.current("front", 2).pixel_size == 0.2


@pytest.mark.parametrize("lost", ["e1", "e2", "branch"])
def test_lost_edits_are_damage(edits: Edits, location: Location, lost: str) -> None:
    for number in range(4):
        edits.save("front", Changes(note=f"note {number}"), "Ann", number)
    index = ObjectRepository.open(location, "duck").index
    if lost == "branch":
        index.delete_branch("edits")
    else:
        index.delete_tag(lost)
    with pytest.raises(DamagedError, match="it has lost edit " + ("4" if lost == "branch" else lost[1:])):
        edits.history()
    with pytest.raises(DamagedError):
        edits.current("front")


def test_damaged_bytes_are_never_served(tmp_path: Path, location: Location) -> None:
    edits = Edits.open(location, "duck")
    noise = np.random.default_rng(0).random((200, 300)) < 0.5
    edits.save("front", Changes(pixel_size=0.5, note="before"), "Ann", 0)
    edits.save("front", Changes(mask=noise), "Ann", 1)
    damage_a_chunk(tmp_path / "store/objects/duck", 5_000)
    fresh = Edits.open(location, "duck")
    with pytest.raises(DamagedError, match=r"mask\.png.* of duck/front/edits in edit 2 is damaged") as caught:
        fresh.current("front")
    assert caught.value.remedy.startswith("restore a backup, or `glint edits duck/front --discard`")
    with pytest.raises(DamagedError):
        fresh.save("front", Changes(verdict="good"), "Ann", 2)
    assert fresh.current("front", 1).pixel_size == 0.5
    fresh.save("back", Changes(verdict="good"), "Ann", 2)
    discarded = fresh.discard("front", "Bob")
    assert discarded is not None and discarded.sentence == "all edits taken back"
    assert fresh.current("front").edited == ()
    assert fresh.discard("front", "Bob") is None


def _save_many(location: Any, writer: int, failures: list[Exception], count: int = 8) -> None:
    """Save notes, and a field of one's own."""
    try:
        edits = Edits.open(location, "duck")
        for number in range(count):
            base = edits.revision
            field = (
                {"pixel_size": number + 1.0} if writer else {"region": {"x": number, "y": 0, "width": 9, "height": 9}}
            )
            edits.save("front", Changes.model_validate(field | {"note": f"{writer}-{number}"}), f"W{writer}", base)
    except Exception as error:
        failures.append(error)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["folder", "memory"])
def test_two_writers_at_once_lose_nothing(kind: str, location: Location) -> None:
    place: Location = location if kind == "folder" else MemoryLocation()
    failures: list[Exception] = []
    writers = [threading.Thread(target=_save_many, args=(place, writer, failures)) for writer in range(2)]
    for thread in writers:
        thread.start()
    for thread in writers:
        thread.join()
    assert not failures
    edits = Edits.open(place, "duck")
    current = edits.current("front")
    assert sorted(note.text for note in current.notes) == sorted(f"{w}-{n}" for w in range(2) for n in range(8))
    assert current.pixel_size == 8.0 and current.region is not None and current.region.x == 7
    assert [item.number for item in edits.history()] == list(range(1, 17))


@pytest.mark.parametrize("kind", ["folder", "memory"])
def test_of_two_people_who_change_one_field_at_once_one_is_refused(kind: str, location: Location) -> None:
    place: Location = location if kind == "folder" else MemoryLocation()
    Edits.open(place, "duck")
    barrier, outcomes = threading.Barrier(2), dict[str, Any]()

    def write(author: str, size: float) -> None:
        edits = Edits.open(place, "duck")
        barrier.wait()
        try:
            outcomes[author] = edits.save("front", Changes(pixel_size=size), author, 0)
        except ConflictError as error:
            outcomes[author] = error

    threads = [threading.Thread(target=write, args=pair) for pair in (("Ann", 1.0), ("Bob", 2.0))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    losers = {name: outcome for name, outcome in outcomes.items() if isinstance(outcome, ConflictError)}
    assert len(losers) == 1 and len(outcomes) == 2
    ((loser, error),) = losers.items()
    winner = "Bob" if loser == "Ann" else "Ann"
    assert error.conflicts[0].author == winner
    assert Edits.open(place, "duck").current("front").changes["pixel_size"].author == winner


def _save_for_ever(location: Location, acknowledged: Path, start: int) -> None:
    edits = Edits.open(location, "duck")
    for number in range(start, start + 10_000):
        changes = Changes(mask=drawn_mask(21 + number % 40), pixel_size=float(number + 1), note=f"note {number}")
        saved = edits.save("front", changes, "Ann", edits.revision)
        assert saved is not None
        with acknowledged.open("a") as file:
            file.write(f"{saved.number} {number}\n")


@pytest.mark.long
def test_a_killed_writer_loses_nothing_acknowledged(location: Location, tmp_path: Path) -> None:
    acknowledged, chance = tmp_path / "acknowledged", random.Random(0)
    for attempt in range(3):
        lines = acknowledged.read_text().count("\n") if acknowledged.exists() else 0
        worker = SPAWN.Process(target=_save_for_ever, args=(location, acknowledged, attempt * 10_000))
        worker.start()
        until(partial(has_grown, acknowledged, lines), pause=0.01)
        time.sleep(chance.uniform(0.0, 0.2))
        assert worker.pid is not None
        os.kill(worker.pid, signal.SIGKILL)
        worker.join()
        edits = Edits.open(location, "duck", create=False)
        pairs = [tuple(map(int, line.split())) for line in acknowledged.read_text().splitlines()]
        texts = [note.text for note in edits.current("front").notes]
        assert [text for text in texts if text in {f"note {n}" for _, n in pairs}] == [f"note {n}" for _, n in pairs]
        assert edits.revision == len(edits.history()) == len(texts), "no revision is half there"
        for number, value in [*pairs[-5:], (edits.revision, int(texts[-1].split()[1]))]:
            state = edits.current("front", number)
            assert state.pixel_size == value + 1
            np.testing.assert_array_equal(state.mask, drawn_mask(21 + value % 40))
    assert edits.save("front", Changes(verdict="good"), "Bob", edits.revision) is not None, "and it goes on"


def test_a_mask_may_come_as_a_picture_in_base64() -> None:
    picture = base64.b64encode(mask_png(drawn_mask())).decode()
    changes = Changes.model_validate_json(f'{{"mask": "{picture}"}}')
    np.testing.assert_array_equal(changes.mask, drawn_mask())
    assert changes.changed == ("mask",)
    np.testing.assert_array_equal(Changes.model_validate_json(changes.model_dump_json()).mask, drawn_mask())
    assert Changes.model_validate_json('{"mask": null, "verdict": "good"}').changed == ("mask", "verdict")


BOMB = base64.b64encode(cv2.imencode(".png", np.zeros((1, 1), np.uint8))[1].tobytes()[:40]).decode()


@pytest.mark.parametrize(
    "text",
    [
        '{"spheres": [{"x": 1, "y": 2, "radius": -3}]}',
        '{"spheres": [{"x": 1, "y": 2, "radius": 3, "colour": "red"}]}',
        f'{{"spheres": {json.dumps(SPHERES * 2)}}}',
        '{"spheres": [{"x": NaN, "y": 2, "radius": 3}]}',
        '{"region": {"x": 1.5, "y": 2, "width": 3, "height": 4}}',
        '{"pose": {}}',
        '{"camera": {"matrix": [[1, 0, 0], [0, -1, 0], [0, 0, 1]]}}',
        '{"pixel_size": 0}',
        '{"marks": [{"frame": -1, "x": 1, "y": 2, "kind": "true"}]}',
        '{"marks": [{"frame": 1, "x": 1, "y": 2, "kind": "maybe"}]}',
        '{"verdict": "<b>good</b>"}',
        '{"note": "\\u001b[31mred"}',
        '{"note": "   "}',
        f'{{"note": "{"x" * 4001}"}}',
        '{"mask": "not base64!"}',
        '{"mask": "aGVsbG8="}',
        f'{{"mask": "{BOMB}"}}',
        f'{{"mask": "{base64.b64encode(mask_png(np.zeros((3, 3), bool))).decode()}"}}',
        '{"mask": [[true]]}',
        '{"frames": "/etc/passwd"}',
        '{"mask": "../../../etc/passwd"}',
        "[]",
    ],
)
def test_hostile_changes_are_refused(text: str) -> None:
    with pytest.raises(ValidationError):
        Changes.model_validate_json(text)


def test_edits_that_are_no_longer_valid_can_be_discarded(edits: Edits) -> None:
    (sphere,) = Changes.model_validate({"spheres": SPHERES}).spheres or ()
    edits.save("front", Changes.model_construct({"spheres"}, spheres=(sphere, sphere)), "Ann", 0)
    with pytest.raises(DamagedError, match="the same circle") as caught:
        edits.current("front")
    assert "glint edits duck/front --discard" in caught.value.remedy
    edits.discard("front", "Ann")
    assert edits.current("front").edited == ()


@pytest.mark.parametrize("author", ["", "  ", "two\nlines", "\x1b[31m", "x" * 300])
def test_hostile_names_are_refused(edits: Edits, author: str) -> None:
    with pytest.raises(InputError, match="the author's name"):
        edits.save("front", Changes(verdict="good"), author, 0)
    with pytest.raises(InputError, match="the sentence"):
        edits.save("front", Changes(verdict="good"), "Ann", 0, author or "\t")
    assert edits.revision == 0


def test_other_bases_and_captures_are_refused(edits: Edits) -> None:
    with pytest.raises(InputError, match="duck/front has edits up to 0, not 3"):
        edits.save("front", Changes(verdict="good"), "Ann", 3)
    with pytest.raises(StoreError, match="cannot be a name"):
        edits.save("../front", Changes(verdict="good"), "Ann", 0)
