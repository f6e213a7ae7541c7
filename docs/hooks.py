"""What the documentation site makes itself: pages of generated reference, and pages that lie outside docs/.

mkdocs calls `on_files` before it reads pages and `on_page_markdown` for each of them.
"""

from __future__ import annotations

import importlib
import inspect
import json
import os
import re
import subprocess
import sys
from pathlib import Path, PurePosixPath
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from pydantic import BaseModel

ROOT = Path(__file__).parent.parent

OUTSIDE = {
    "policies/bundled/README.md": "bundled.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changes.md",
    "README.md": "index.md",
}
"""Pages of the repository that the site takes in, by where they stand in it."""

FOLDERS = {"docs/decisions": "decisions/README.md", "docs/lab": "lab/README.md"}

SETTINGS = {
    "Config": "nathlon.selection.config",
    "FilterSettings": "nathlon.selection.pareto.filter",
    "Objective": "nathlon.selection.pareto.objective",
    "BatterySettings": "nathlon.selection.battery",
    "CommitteeSettings": "nathlon.selection.committee.rules",
    "Rule": "nathlon.selection.committee.rules",
    "Gates": "nathlon.selection.committee.rules",
    "TournamentSettings": "nathlon.selection.round_robin",
    "GateSettings": "nathlon.selection.gate_settings",
    "MatrixSettings": "nathlon.selection.matrix_settings",
    "NightlySettings": "nathlon.selection.config",
    "ResultSettings": "nathlon.selection.result_settings",
    "Event": "nathlon.tournament.event",
    "EventRace": "nathlon.tournament.event",
    "Skill": "nathlon.selection.battery.skill",
    "Gains": "nathlon.selection.battery.skill",
}
"""The models of the configuration by name, and their modules."""

TABLES = "arena/results.py"
COLUMN = re.compile(r'^\s+"(?P<name>\w+)": pl\.(?P<type>\w+),(?:\s+# (?P<about>.*))?$')
LINK = re.compile(r"(?P<text>!?\[(?:[^\[\]]|\[[^\]]*\])*\])\((?P<target>[^()\s]+)\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are not files in docs/."""
    pages = {
        "reference/command-line.md": command_line(),
        "reference/configuration.md": (ROOT / "docs/reference/configuration.md").read_text("utf-8")
        + settings(),
        "reference/measures.md": (ROOT / "docs/reference/measures.md").read_text("utf-8") + tables(),
    }
    for source, page in OUTSIDE.items():
        if page != "index.md":
            pages[page] = (ROOT / source).read_text("utf-8")
    for page, text in pages.items():
        there = files.get_file_from_path(page)
        if there:
            files.remove(there)
        files.append(File.generated(config, page, content=text))
    curves = "policies/bundled/curves.svg"
    files.append(File.generated(config, "curves.svg", abs_src_path=str(ROOT / curves)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links of the repository into links of the site; what is not on the site loses its link."""
    generated = {page: source for source, page in OUTSIDE.items()}
    source = PurePosixPath(generated.get(page.file.src_uri, f"docs/{page.file.src_uri}"))
    here = PurePosixPath(page.file.src_uri).parent

    def on_site(found: re.Match[str]) -> str:
        target, _, anchor = found["target"].partition("#")
        if not target or "://" in target or target.startswith("mailto:"):
            return found[0]
        path = os.path.normpath(source.parent / target)
        place = OUTSIDE.get(path) or FOLDERS.get(path)
        if place is None and path.startswith("docs/"):
            place = path.removeprefix("docs/")
        if path == "policies/bundled/curves.svg":
            place = "curves.svg"
        if place is None:
            if not (ROOT / path).exists():
                return found[0]  # mkdocs says that it leads nowhere
            return found["text"][1:-1]
        return f"{found['text']}({os.path.relpath(place, here)}{'#' + anchor if anchor else ''})"

    return LINK.sub(on_site, markdown)


def command_line() -> str:
    """Every command with its options, as the command line itself tells them."""
    made = subprocess.run(
        [sys.executable, "-m", "typer", "nathlon.cli", "utils", "docs", "--name", "nathlon"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    return made.stdout.replace("# `nathlon`", "# Command line", 1)


def settings() -> str:
    """The fields of every model of the configuration, with type, default and meaning."""
    parts = []
    for name, module in SETTINGS.items():
        model = getattr(importlib.import_module(module), name)
        summary, meanings = meanings_of(inspect.getdoc(model) or "")
        parts.append(f"\n## `{name}`\n\n{summary}\n")
        parts.append("| field | type | default | meaning |\n| --- | --- | --- | --- |")
        for field, about in model.model_fields.items():
            value = about.get_default(call_default_factory=True)
            default = "required" if about.is_required() else default_of(value)
            kind = kind_of(about.annotation)
            parts.append(f"| `{field}` | {kind} | {default} | {meanings.get(field, '')} |")
    return "\n".join(parts) + "\n"


def kind_of(annotation: Any) -> str:
    """A type in words, without its limits; a model as a link to its fields."""
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return kind_of(inner[0])
    if origin in (Union, UnionType):
        return " or ".join(kind_of(part) for part in inner if part is not NoneType)
    if origin is Literal:
        return " or ".join(f"`{value}`" for value in inner)
    if origin is tuple:
        return f"list of {kind_of(inner[0])}"
    if origin is dict:
        return f"table of {kind_of(inner[1])}"
    name = annotation.__name__
    if name in SETTINGS:
        return f"[{name}](#{name.lower()})"
    return {"str": "string", "int": "integer", "float": "number", "bool": "true or false"}.get(name, name)


def default_of(value: object) -> str:
    """A default as TOML would have it; of a table of its own, nothing."""
    if value is None:
        return "none"
    if any(isinstance(part, BaseModel) for part in (value if isinstance(value, tuple) else (value,))):
        return "its own"
    return f"`{json.dumps(value)}`"


def meanings_of(docstring: str) -> tuple[str, dict[str, str]]:
    """The first paragraph of a docstring, and what it says of each attribute."""
    summary, _, attributes = docstring.partition("\nAttributes:\n")
    meanings: dict[str, str] = {}
    for names, about in re.findall(r"^    ([\w, ]+): (.*(?:\n {5,}.*)*)", attributes, re.MULTILINE):
        meanings |= {name: " ".join(about.split()) for name in names.split(", ")}
    return summary.split("\n\n")[0].replace("\n", " "), meanings


def tables() -> str:
    """The tables of a selection with their columns, read from the comments beside them."""
    parts, name = ["\n## Tables\n"], ""
    for line in (ROOT / TABLES).read_text("utf-8").splitlines():
        if begins := re.match(r"([A-Z_]+) = pl\.Schema\(", line):
            name = begins[1].lower()
            parts.append(f"\n### `{name}`\n\n| column | type | |\n| --- | --- | --- |")
            columns = re.findall(r'"(\w+)": pl\.(\w+)\}', line)  # of a table of one line
            parts += [f"| `{column}` | {kind} | |" for column, kind in columns]
        elif column := COLUMN.match(line):
            parts.append(f"| `{column['name']}` | {column['type']} | {column['about'] or ''} |")
    return "\n".join(parts) + "\n"
