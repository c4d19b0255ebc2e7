"""On the review page a remedy names the page's tools, not the files of `glint check` or keys of the catalogue."""

import ast
from pathlib import Path

import pytest

from glint import tasks as tasks_package
from glint.flows.review.remedies import PAINT, on_page
from glint.flows.runtime import signals

TASKS = Path(tasks_package.__file__).parent
ELSEWHERE = ("glint check", "`spheres", "`mask", "`camera", "`pixel_size", "`diameter_mm", "in the catalogue")
"""What is no remedy on the page."""


def texts(path: Path) -> list[str]:
    """The texts of a module, with X for what is filled in, without its docstrings and the parts of other texts."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    within = {id(child) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for child in ast.walk(node)}
    notes = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            parts = (str(part.value) if isinstance(part, ast.Constant) else "X" for part in node.values)
            found.append("".join(parts))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in within | notes:
            found.append(node.value)
    return found


SPOKEN = [
    text
    for path in (*TASKS.glob("stages/*.py"), *TASKS.glob("*.py"), *TASKS.glob("algorithms/[lm][ia]*/*.py"))
    for text in texts(path)
    if any(words in text for words in ELSEWHERE) and "drew spheres" not in text and "lights" not in text
]


@pytest.mark.parametrize("text", SPOKEN)
def test_what_stages_say_is_said_in_the_words_of_the_page(text: str) -> None:
    assert not [words for words in ELSEWHERE if words in on_page(text)]


def test_a_scale_is_corrected_by_the_tool() -> None:
    told = "`pixel_size` 0.001 makes the object 0.3 mm large: give the millimetres that one pixel covers"
    assert on_page(told) == "the scale 0.001 makes the object 0.3 mm large: correct it with Scale"
    grain = "`diameter_mm` 2.5 is that of a grain: give it in millimetres"
    assert on_page(grain) == "the sphere's diameter 2.5 is that of a grain: give it in millimetres"
    unknown = "give `pixel_size`, or a sphere's `diameter_mm`, for all views or for none"
    assert on_page(unknown) == "give it with Scale for all views or for none"


def test_what_an_input_or_a_run_lacks_is_mended_on_the_page() -> None:
    assert on_page("it must have the frame's 288 x 176 pixels").endswith("pixels; or " + PAINT)
    assert on_page("paint the object white on black, or leave the mask out to have it estimated") == PAINT
    assert on_page(signals.LINE.removeprefix("glint: ")) == "the run was interrupted"


def test_what_names_no_file_and_no_key_is_left_as_it_is() -> None:
    assert len(SPOKEN) >= 10
    text = "the sphere leaves the frame: use a plain background"
    assert on_page(text) == text
    offered = "give this capture `spheres: [{x: 1.0, y: 2.0, radius: 3.0}]`, as in the others"
    assert on_page(offered) == "set its circle with Spheres to {x: 1.0, y: 2.0, radius: 3.0}, as in the others"
