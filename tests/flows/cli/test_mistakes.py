"""Mistakes on the command line: the offending value and the remedy are named before anything is computed."""

import socket
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest
from typer.testing import CliRunner

from glint.flows.cli.main import app
from glint.flows.cli.output import counted
from glint.flows.cli.review import _listener, _origins
from glint.storage.catalogue.loading import Catalogue, load, write
from glint.storage.errors import GlintError, InputError, OutputError

CAPTURE = {"id": "front", "frames": "front.mp4"}


@pytest.fixture
def catalogue(tmp_path: Path) -> Path:
    """A catalogue whose video is absent and whose capture has no ground truth."""
    objects = [{"id": "duck", "captures": [CAPTURE]}]
    write(Catalogue.model_validate({"schema": 1, "name": "test", "objects": objects}), tmp_path / "catalogue.yaml")
    return tmp_path / "catalogue.yaml"


@pytest.mark.parametrize(
    ("words", "message", "remedy"),
    [
        ("maintain --frames-budget lots --store x", "'lots' is not a size", "20GB"),
        ("simulate mug --out x --set noise", "--set noise gives no value", "noise=VALUE"),
        ("simulate mug --out x --set noise=loud", "noise=loud: Input should be a valid number", "--help"),
        ("simulate mug --out x --seed -1", "seed=-1 cannot be simulated", "--help"),
        ("deploy --inbox nowhere --store x", "nowhere is not a folder", "create it"),
        ("deploy --inbox catalogue.yaml --store x", "catalogue.yaml is not a folder", "create it"),
        ("deploy --inbox-may-read nowhere --store x", "--inbox-may-read", "create it"),
        ("deploy --reference nowhere.yaml --store x", "nowhere.yaml", "check"),
        ("deploy --reference catalogue.yaml --store x", "names its ground truth", "truth: FOLDER"),
        ("review --store x --origin glint.example", "--origin glint.example is not an address", "https://"),
        ("review --store x --origin https://glint.example/page", "https://glint.example/page is not", "without a path"),
        ("review --store x --origin http://glint.example:99999", "http://glint.example:99999 is not", "any port"),
        ("review --store x --host 0.0.0.0", "--host 0.0.0.0 listens on every address", "--origin http://"),
        ("review --store x --host ::", "--host :: listens on every address", "--origin http://"),
        ("history duck/front", "duck/front is a capture", "name only the object: duck"),
        ("evaluate --only teapot --out out", "--only teapot is not a preset", "hemisphere, cylinder"),
        ("evaluate catalogue.yaml --out out", "names its ground truth", "truth: FOLDER"),
        ("evaluate catalogue.yaml --only dukc --out out", "the catalogue has no dukc", "did you mean duck?"),
        ("check catalogue.yaml --only duck/back", "the catalogue has no duck/back", "did you mean duck/front?"),
        ("check catalogue.yaml --only goose/back", "the catalogue has no goose/back", "name OBJECT or OBJECT/CAPTURE"),
    ],
)
def test_a_mistake_is_named_before_anything_is_computed(
    catalogue: Path, monkeypatch: pytest.MonkeyPatch, words: str, message: str, remedy: str
) -> None:
    monkeypatch.chdir(catalogue.parent)
    monkeypatch.setenv("GLINT_REVIEW_PASSWORD", "a long password")
    done = CliRunner().invoke(app, words.split())
    assert isinstance(done.exception, GlintError)
    assert message in done.exception.message and remedy in done.exception.remedy
    assert not list(catalogue.parent.glob("out/*"))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("catalogue.yaml --quick", "--quick is for simulated captures"),
        ("catalogue.yaml --degraded", "--degraded is for simulated captures"),
        ("--perturbed --degraded", "--perturbed and --degraded exclude each other"),
        ("--perturbed --ablation --questions 3", "--perturbed and --ablation, --questions exclude each other"),
    ],
)
def test_options_of_evaluate_that_would_be_ignored_are_refused(
    catalogue: Path, monkeypatch: pytest.MonkeyPatch, words: str, message: str
) -> None:
    monkeypatch.chdir(catalogue.parent)
    done = CliRunner().invoke(app, ["evaluate", "--out", "out", *words.split()], env={"COLUMNS": "200"})
    assert done.exit_code == 2 and message in done.output
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("simulate mug --out out --frames 1", "'1': input should be greater than or equal to 2"),
        ("simulate mug --out out --frames 9999999999", "'9999999999': input should be less than or equal to 1000000"),
        ("simulate mug --out out --scale big", "'big': input should be a valid number"),
        ("maintain --older-than -1", "'-1': input should be greater than or equal to 0"),
    ],
)
def test_an_option_out_of_range_is_shown_with_its_value(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, words.split(), env={"COLUMNS": "200"})
    assert done.exit_code == 2 and f"{words.split()[-2]}': {message}" in done.output
    assert not list(tmp_path.iterdir())


def test_an_origin_is_written_as_browsers_send_it() -> None:
    given = ["HTTPS://Glint.example:443/", "http://[::1]:4300", "http://10.0.0.1:80"]
    assert _origins(given, "0.0.0.0") == ("https://glint.example", "http://[::1]:4300", "http://10.0.0.1")


def test_pages_that_start_at_once_take_ports_of_their_own() -> None:
    pages, rounds = 8, 40
    start = Barrier(pages)

    def listener(_: int) -> socket.socket:
        start.wait()
        return _listener("127.0.0.1", None)

    with ThreadPoolExecutor(pages) as pool:
        for _ in range(rounds):
            listeners = list(pool.map(listener, range(pages)))
            assert len({item.getsockname() for item in listeners}) == pages
            for item in listeners:
                item.close()


def test_a_new_store_has_no_objects(tmp_path: Path, glint_home: Path) -> None:
    done = CliRunner().invoke(app, ["status", "--store", str(tmp_path)])
    assert done.exit_code == 0 and f"no objects in the store {tmp_path}" in done.output.replace("\n", "")


@pytest.mark.parametrize(
    "words",
    [
        "status",
        "status --json",
        "review",
        "history duck",
        "edits duck",
        "diff duck v1 v2",
        "rollback duck v1",
        "export duck --out out",
        "verify",
        "maintain",
    ],
)
def test_a_store_that_does_not_exist_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, glint_home: Path, words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "videos").mkdir()
    (tmp_path / "videos" / "front.mp4").touch()
    for store, message in (("absent", "there is no store"), ("videos", "holds other files and no store")):
        done = CliRunner().invoke(app, [*words.split(), "--store", store])
        assert isinstance(done.exception, GlintError) and message in done.exception.message
        assert str(tmp_path / store) in done.exception.message and "check the path" in done.exception.remedy
    assert [path.name for path in tmp_path.iterdir()] == ["videos"], "nothing is made where there is no store"


def test_commands_that_are_suggested_quote_their_paths(catalogue: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(catalogue.parent)
    catalogue.rename("my glass.yaml")
    done = CliRunner().invoke(app, ["check", "my glass.yaml", "--store", "a store"])
    assert "then glint check 'my glass.yaml' --store 'a store'" in done.output


def test_a_check_that_finds_nothing_usable_does_not_suggest_a_run(
    catalogue: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(catalogue.parent)
    done = CliRunner().invoke(app, ["check", "catalogue.yaml"])
    assert done.exit_code == 1
    assert "then glint check catalogue.yaml" in done.output and "glint run" not in done.output
    _, row, blank, reason, picture, *_ = done.output[done.output.index("capture  ") :].splitlines()
    assert (row.split(), blank) == (["duck/front", "correct", "the", "catalogue"], "")
    assert "glint review catalogue.yaml" in done.output
    assert reason.startswith("duck/front: correct the catalogue: ") and "front.mp4" in reason
    assert picture == "", "there is none"


@pytest.mark.parametrize(
    ("error", "text"), [(ValueError("arange"), "ValueError: arange"), (OSError(5, "I/O error"), "I/O error")]
)
def test_a_check_reports_what_nobody_expected_of_one_capture(
    catalogue: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, text: str
) -> None:
    def fails(*_: object) -> None:
        raise error

    monkeypatch.chdir(catalogue.parent)
    monkeypatch.setattr("glint.tasks.check.check", fails)
    done = CliRunner().invoke(app, ["check", "catalogue.yaml"])
    assert done.exit_code == 1 and isinstance(done.exception, SystemExit)
    assert "duck/front" in done.output and f"{text}: internal error" in done.output


def test_a_check_ends_where_its_pictures_cannot_be_written(catalogue: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise OutputError("out cannot be written", "name another folder with --out")

    monkeypatch.chdir(catalogue.parent)
    monkeypatch.setattr("glint.tasks.check.check", fails)
    assert isinstance(CliRunner().invoke(app, ["check", "catalogue.yaml"]).exception, OutputError)


def test_a_port_that_is_taken_is_named() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        number = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"port {number} of 127.0.0.1 is taken"):
            _listener("127.0.0.1", number)


def test_an_address_of_another_machine_is_not_taken_for_a_port_that_is_taken() -> None:
    for port in (None, 4300):
        with pytest.raises(InputError, match=r"--host 192\.0\.2\.1 is not an address of this machine"):
            _listener("192.0.2.1", port)


def test_a_catalogue_that_cannot_be_written_is_named_itself(catalogue: Path, tmp_path: Path) -> None:
    with pytest.raises(OSError) as caught:
        write(load(catalogue), tmp_path / "absent" / "c.yaml")
    assert caught.value.filename == str(tmp_path / "absent" / "c.yaml")


def test_the_version_is_printed() -> None:
    done = CliRunner().invoke(app, ["--version"])
    assert done.exit_code == 0 and done.output.startswith("glint ")


def test_counts_agree_with_their_nouns() -> None:
    assert [counted(number, "object") for number in (0, 1, 2_000)] == ["0 objects", "1 object", "2,000 objects"]


@pytest.mark.parametrize("option", ["--dry-run", "--json"])
def test_maintenance_creates_no_store(option: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["maintain", "--store", str(tmp_path / "typo"), option])
    assert done.exit_code != 0 and not (tmp_path / "typo").exists()


def test_an_object_that_a_killed_simulation_was_replacing_is_named(tmp_path: Path) -> None:
    call = ["simulate", "mug", "--frames", "2", "--scale", "0.1", "--out", str(tmp_path)]
    assert CliRunner().invoke(app, call).exit_code == 0
    (tmp_path / "mug").rename(tmp_path / ".mug-earlier")
    done = CliRunner().invoke(app, call)
    assert done.exit_code == 0 and f"{tmp_path / 'mug'} is again" in done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"catalogue.yaml", "mug"}


def test_a_folder_that_was_not_simulated_is_not_replaced(tmp_path: Path) -> None:
    own = tmp_path / "mug" / "front" / "video.mp4"
    own.parent.mkdir(parents=True)
    own.write_bytes(b"mine")
    done = CliRunner().invoke(app, ["simulate", "mug", "--frames", "2", "--out", str(tmp_path)])
    assert isinstance(done.exception, GlintError) and f"{tmp_path / 'mug'} holds front" in done.exception.message
    assert "--out" in done.exception.remedy and own.read_bytes() == b"mine"
    (own.parent / "meta.json").write_text("{}")
    done = CliRunner().invoke(app, ["simulate", "mug", "--frames", "2", "--scale", "0.1", "--out", str(tmp_path)])
    assert done.exit_code == 0 and own.read_bytes() != b"mine"
