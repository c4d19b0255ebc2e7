"""The viewer's modules as one script, for a page that has no server to load modules from.

Browsers do not load modules from files on a disk. Each module becomes a function that returns what it exports; a page
needs one inline script, whose digest is all that its content security policy has to allow. It understands the forms of
import and export that the viewer's modules and the vendored ones use: named ones, from relative addresses.
"""

import posixpath
import re
from functools import cache
from pathlib import Path

VIEWER = Path(__file__).with_name("static")
"""The viewer's modules, style and vendored libraries; a server may serve this folder as it is."""
_IMPORT = re.compile(r"""(?:^|(?<=;)|(?<=\n)|(?<=\*/))\s*import\s*\{([^}]*)\}\s*from\s*["'](\.[^"']+)["'];?""")
_EXPORT_FROM = re.compile(r"""export\s*\{([^}]*)\}\s*from\s*["'](\.[^"']+)["'];?""")
_EXPORT_LIST = re.compile(r"export\s*\{([^}]*)\};?")
_EXPORT_DECLARATION = re.compile(r"^export (?=(?:async )?(?:function|class|const)\b)", re.MULTILINE)
_DECLARED = re.compile(r"^export (?:async )?(?:function\*?|class|const) (\w+)", re.MULTILINE)


@cache
def bundled(entry: str) -> str:
    """Return the module `entry` of VIEWER and all that it imports as one script.

    Raises:
        ValueError: modules import each other in a circle, or use another form of import.
    """
    order: list[str] = []
    _collect(entry, order, ())
    names = {module: f"$module{number}" for number, module in enumerate(order)}
    wrapped = [f"const {names[module]} = (() => {{\n{_as_function(module, names)}\n}})();" for module in order]
    return '"use strict";\n' + "\n".join(wrapped) + "\n"


def _collect(module: str, order: list[str], above: tuple[str, ...]) -> None:
    """Append a module to `order` after all that it imports."""
    if module in above:
        raise ValueError(f"modules import each other: {' -> '.join((*above, module))}")
    if module in order:
        return
    source = _source(module)
    for pattern in (_IMPORT, _EXPORT_FROM):
        for _, address in pattern.findall(source):
            _collect(_resolved(module, address), order, (*above, module))
    order.append(module)


def _as_function(module: str, names: dict[str, str]) -> str:
    """Return the body of a function that returns the module's exports as an object."""
    source = _source(module)
    exports: list[str] = []
    for pattern in (_EXPORT_FROM, _IMPORT):
        is_export = pattern is _EXPORT_FROM

        def replaced(match: re.Match[str], is_export: bool = is_export) -> str:
            other = names[_resolved(module, match[2])]
            if is_export:
                exports.extend(f"{public}: {other}.{local}" for local, public in _pairs(match[1]))
                return ""
            taken = ", ".join(f"{public}: {local}" for public, local in _pairs(match[1]))
            return f"const {{{taken}}} = {other};"

        source = pattern.sub(replaced, source)
    exports += [f"{name}: {name}" for name in _DECLARED.findall(source)]
    source = _EXPORT_DECLARATION.sub("", source)
    for listed in _EXPORT_LIST.findall(source):
        exports += [f"{public}: {local}" for local, public in _pairs(listed)]
    source = _EXPORT_LIST.sub("", source)
    if re.search(r"^\s*(import|export)\b(?!\()", source, re.MULTILINE):
        raise ValueError(f"{module} imports or exports in a form that cannot be bundled")
    return f"{source}\nreturn {{{', '.join(exports)}}};"


def _pairs(listed: str) -> list[tuple[str, str]]:
    """Return the name and the new name of each entry of a list such as `a as b, c`."""
    entries = [re.split(r"\s+as\s+", entry.strip()) for entry in listed.split(",") if entry.strip()]
    return [(entry[0], entry[-1]) for entry in entries]


def _resolved(module: str, address: str) -> str:
    return posixpath.normpath(posixpath.join(posixpath.dirname(module), address))


def _source(module: str) -> str:
    return (VIEWER / module).read_text(encoding="utf-8")
