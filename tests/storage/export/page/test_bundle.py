"""The viewer's modules as one script."""

from pathlib import Path

import pytest

from glint.storage.export.page import bundle


@pytest.fixture
def modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(bundle, "VIEWER", tmp_path)
    bundle.bundled.cache_clear()
    return tmp_path


def test_imports_become_constants_in_the_order_of_their_use(modules: Path) -> None:
    (modules / "start.js").write_text('import { a as b, c } from "./sub/x.js";\nexport const sum = b + c;\n')
    (modules / "sub").mkdir()
    (modules / "sub/x.js").write_text(
        'import {d} from "../y.js";export {d as again} from "../y.js";const a=d,z=2;export{a,z as c};'
    )
    (modules / "y.js").write_text("export const d = 1;\nexport function f() {}\nexport class G {}\n")
    script = bundle.bundled("start.js")
    assert script.index("const d = 1") < script.index("const a=d") < script.index("const sum = b + c")
    assert "return {d: d, f: f, G: G};" in script and "return {again: $module0.d, a: a, c: z};" in script
    assert "const {a: b, c: c} = $module1;" in script


@pytest.mark.parametrize("source", ['import x from "./y.js";', 'import * as x from "./y.js";', "export default 3;"])
def test_other_forms_are_refused(modules: Path, source: str) -> None:
    (modules / "start.js").write_text(source)
    (modules / "y.js").write_text("")
    with pytest.raises(ValueError, match="cannot be bundled"):
        bundle.bundled("start.js")


def test_circles_are_refused(modules: Path) -> None:
    (modules / "x.js").write_text('import { y } from "./y.js";\nexport const x = 1;\n')
    (modules / "y.js").write_text('import { x } from "./x.js";\nexport const y = 1;\n')
    with pytest.raises(ValueError, match=r"x\.js -> y\.js -> x\.js"):
        bundle.bundled("x.js")


def test_modules_are_plain_and_name_no_other_site() -> None:
    for path in bundle.VIEWER.glob("*.*"):
        text = path.read_text(encoding="utf-8")
        assert "http" not in text.replace("http://www.w3.org/2000/svg", "").replace("http-equiv", ""), path
        assert path.suffix != ".js" or len(text.splitlines()) <= 250, path
        assert "innerHTML" not in text and "eval(" not in text, path
    assert "MIT License" in (bundle.VIEWER / "vendor/three/LICENSE").read_text(encoding="utf-8")
