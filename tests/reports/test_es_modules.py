"""Pages' scripts: ES modules that become one script."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Browser

from nathlon.reports.es_modules import Module, bundle, read_module
from nathlon.reports.self_contained import TEMPLATES
from tests.support.page_modules import module


def write(folder: Path, **modules: str) -> Path:
    (folder / "part").mkdir()
    for name, text in modules.items():
        (folder / f"{name.replace('_', '/')}.js").write_text(text + "\n")
    return folder


def test_modules_run_once_each_before_those_that_import_them(browser: Browser, tmp_path: Path) -> None:
    """`$modules` is the bundle's own; a name is the module's alone, whatever others call theirs."""
    write(
        tmp_path,
        entry='import { told } from "./part/told.js";\n'
        'import {\n  say, Said,\n  later,\n} from "./say.js";\n\n'
        'const name = "entry";\nsay(new Said(name).name);\nexport const all = () => told;\n'
        "export const soon = () => later();",
        say='import { told } from "./part/told.js";\n\nconst name = "say";\nsay(name);\n'
        "export function say(what) {\n  told.push(what);\n}\n"
        "export class Said {\n  constructor(name) {\n    this.name = name;\n  }\n}\n"
        "export async function later() {\n  return name;\n}",
        part_told='const name = "told";\nexport const told = [name]; // once',
    )
    page = browser.new_page()
    script = f"async () => {{ {bundle(tmp_path, 'entry.js')} const {{ all, soon }} = $modules['entry.js'];"
    assert page.evaluate(f"{script} return [...all(), await soon()]; }}") == ["told", "say", "entry", "say"]
    page.close()


@pytest.mark.parametrize(
    ("text", "refusal"),
    [
        ('import { gone } from "./part/b.js";', r"entry\.js: part/b\.js does not export gone\."),
        (
            'import { b as c } from "./part/b.js";',
            r'entry\.js: "import \{ b as c \} from.* is not in a form that',
        ),
        ('import * as b from "./part/b.js";', r'entry\.js: "import \* as b from.*" is not in'),
        ('import b from "./part/b.js";', r'entry\.js: "import b from.*" is not in'),
        ('import { b } from "library";', r'entry\.js: "import \{ b \} from "library";" is not in a form'),
        ("export let a = 1;", r'entry\.js: "export let a = 1;" is not in a form that pages can have\.'),
        ("export const [a, b] = [1, 2];", r'entry\.js: "export const \[a, b\] = .*" is not in a form'),
        ("export default 1;", r'entry\.js: "export default 1;" is not in a form'),
        ('import { c } from "./part/c.js";', r"import from each other: .*c\.js < .*d\.js < .*c\.js"),
    ],
)
def test_what_a_page_cannot_have_is_refused(tmp_path: Path, text: str, refusal: str) -> None:
    write(
        tmp_path,
        entry=text,
        part_b="export const b = 1;",
        part_c='import { d } from "./d.js";\nexport const c = d;',
        part_d='import { c } from "./c.js";\nexport const d = c;',
    )
    with pytest.raises(ValueError, match=refusal):
        bundle(tmp_path, "entry.js")


def test_a_module_that_is_not_there_is_named(tmp_path: Path) -> None:
    write(tmp_path, entry='import { b } from "./b.js";')
    with pytest.raises(FileNotFoundError, match=r"b\.js"):
        bundle(tmp_path, "entry.js")


@pytest.fixture(scope="module")
def modules() -> dict[str, Module]:
    """All that pages have, by name."""
    names = [path.relative_to(TEMPLATES).as_posix() for path in TEMPLATES.rglob("*.js")]
    return {name: read_module(TEMPLATES, name) for name in names}


def test_modules_export_only_what_another_imports(modules: dict[str, Module]) -> None:
    imported = {
        (source, name) for one in modules.values() for source, these in one.imports.items() for name in these
    }
    exported = {(name, export) for name, one in modules.items() for export in one.exports}
    assert sorted(exported - imported) == []


def test_a_module_that_no_other_imports_is_named_by_what_writes_a_page(modules: dict[str, Module]) -> None:
    first = set(modules).difference(source for one in modules.values() for source in one.imports)
    package = TEMPLATES.parents[1]
    writers = [*package.glob("reports/*.py"), *package.glob("lab/*/*.py")]
    python = "\n".join(path.read_text("utf-8") for path in writers)
    assert sorted(name for name in first if f'"{name}"' not in python) == []


def test_names_of_modules_are_not_the_page_s(browser: Browser) -> None:
    page = browser.new_page()
    page.set_content(f'<p id="p"></p><script type="module">{module("rank.js")}</script>')
    assert page.evaluate("[typeof rankText, typeof $modules]") == ["undefined", "undefined"]
    page.close()
