"""ES modules of a folder as one script, for pages that are one file."""

from __future__ import annotations

import re
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from posixpath import dirname, join, normpath
from typing import NamedTuple

IMPORT = re.compile(r'^import \{(\s*\w+(?:,\s*\w+)*,?\s*)\} from "(\.{1,2}/[^"]+)";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:const|class|function|async function) (\w+))", re.MULTILINE)
OTHER_FORM = re.compile(r"^(?:import|export)\b.*", re.MULTILINE)
NAME = re.compile(r"\w+")


class Module(NamedTuple):
    """A module.

    Attributes:
        imports: names, by the module that they are from.
        exports: its names for other modules.
        body: the rest of its text.
    """

    imports: dict[str, list[str]]
    exports: list[str]
    body: str


def bundle(folder: Path, entry: str) -> str:
    """A script that does what a module does, in a browser that has no other file.

    Every module becomes a function that runs once, after those from which it imports, so its names remain its
    own. What they export is in `$modules`, by module.

    Args:
        folder: to which names of modules are relative.
        entry: the module's name, `app/app.js`.

    Raises:
        ValueError: for imports and exports in other forms than `import { a, b } from "./file.js";` and
            `export const a` (or class, function, async function), names that are not exported, and modules
            that import from each other.
        OSError: if there is no such file.
    """
    modules: dict[str, Module] = {}
    wanted = [entry]
    while wanted:
        name = wanted.pop()
        if name not in modules:
            modules[name] = read_module(folder, name)
            wanted += modules[name].imports
    for name, module in modules.items():
        for source, names in module.imports.items():
            unknown = sorted(set(names).difference(modules[source].exports))
            if unknown:
                raise ValueError(f"{name}: {source} does not export {', '.join(unknown)}.")
    try:
        order = list(TopologicalSorter({name: one.imports for name, one in modules.items()}).static_order())
    except CycleError as error:
        raise ValueError(f"Modules import from each other: {' < '.join(error.args[1])}.") from None
    return "\n".join(["const $modules = {};", *(_function(name, modules[name]) for name in order)])


def read_module(folder: Path, name: str) -> Module:
    """A module of a folder; see `bundle`."""
    text = (folder / name).read_text("utf-8")
    imports = {
        normpath(join(dirname(name), source)): NAME.findall(names) for names, source in IMPORT.findall(text)
    }
    body = EXPORT.sub("", IMPORT.sub("", text))
    other = OTHER_FORM.search(body)
    if other:
        raise ValueError(f'{name}: "{other[0]}" is not in a form that pages can have.')
    return Module(imports, EXPORT.findall(text), body)


def _function(name: str, module: Module) -> str:
    imports = [
        f'const {{ {", ".join(names)} }} = $modules["{source}"];' for source, names in module.imports.items()
    ]
    exports = f"return {{ {', '.join(module.exports)} }};"
    return "\n".join([f'$modules["{name}"] = (() => {{', *imports, module.body + exports, "})();"])
