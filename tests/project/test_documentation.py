"""The pages keep to the house's rules, and the site builds whole and needs no network."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parent.parent.parent
PAGES = [
    *(path for path in (ROOT / "docs").rglob("*.md")),
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "policies/bundled/README.md")),
]
LONGEST = 200

needs_mkdocs = pytest.mark.skipif(
    not all(map(find_spec, ("mkdocs", "material", "mkdocstrings"))), reason="needs the extra dev"
)


@pytest.mark.parametrize("page", PAGES, ids=[str(page.relative_to(ROOT)) for page in PAGES])
def test_no_line_is_too_long_to_read(page: Path) -> None:
    lines = enumerate(page.read_text("utf-8").splitlines(), 1)
    assert not [f"line {number}" for number, line in lines if len(line) > LONGEST]


@pytest.mark.parametrize("page", PAGES, ids=[str(page.relative_to(ROOT)) for page in PAGES])
def test_links_to_files_lead_somewhere(page: Path) -> None:
    """Also where mkdocs does not look: files of the repository that are not on the site."""
    text = re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.DOTALL)
    generated = {"command-line.md", "bundled.md", "changes.md", "contributing.md"}
    for target in re.findall(r"\]\(([^()#\s]+)(?:#[^()\s]*)?\)", text):
        if "://" not in target and Path(target).name not in generated:
            assert (page.parent / target).exists(), target


def test_the_workflow_for_nights_keeps_its_store_whatever_a_night_comes_to() -> None:
    """`actions/cache` saves after success alone, and never twice under one key."""
    [block] = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "nightly.md").read_text("utf-8"), re.DOTALL)
    steps = yaml.safe_load(block)["jobs"]["select"]["steps"]
    actions = [step.get("uses", "").partition("@")[0] for step in steps]
    night = next(number for number, step in enumerate(steps) if "nathlon nightly" in step.get("run", ""))
    restored, saved = actions.index("actions/cache/restore"), actions.index("actions/cache/save")
    assert "actions/cache" not in actions
    assert restored < night < saved
    assert steps[saved]["if"] == "always()"
    assert steps[saved]["with"]["key"] == steps[restored]["with"]["key"]
    assert "run_attempt" in steps[saved]["with"]["key"]
    # Committed writes of a process that was killed are in the `-wal` file; what was sent is looked for later.
    assert steps[saved]["with"]["path"].split("\n") == ["nathlon.sqlite*", "nights/*/sent"]


class Loads(HTMLParser):
    """Addresses that a page loads from elsewhere when it is opened."""

    def __init__(self) -> None:
        super().__init__()
        self.found: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        loaded = [values.get("src"), values.get("href") if tag == "link" else None]
        if values.get("rel") not in ("canonical", "next", "prev"):
            self.found |= {value for value in loaded if value and re.match(r"(https?:)?//", value)}


@needs_mkdocs
def test_the_site_builds_without_a_warning_and_loads_nothing_from_elsewhere(tmp_path: Path) -> None:
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stderr
    pages = list(tmp_path.rglob("*.html"))
    assert {"index.html", "tutorial.html", "bundled.html", "command-line.html"} <= {p.name for p in pages}
    loads = Loads()
    for page in pages:
        loads.feed(page.read_text("utf-8"))
    assert not loads.found
    assert "nathlon evaluate" in (tmp_path / "reference" / "command-line.html").read_text("utf-8")
    assert "keep_probability" in (tmp_path / "reference" / "configuration.html").read_text("utf-8")
    assert "points_per_race" in (tmp_path / "reference" / "measures.html").read_text("utf-8")


@needs_mkdocs
@pytest.mark.parametrize("link", ["nowhere.md", "training.md#nowhere"])
def test_a_dead_link_fails_the_build(link: str, tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text(f"# Home\n\n[there]({link})\n")
    (tmp_path / "docs" / "training.md").write_text("# Training\n")
    settings = (ROOT / "mkdocs.yml").read_text("utf-8")
    kept = settings.partition("hooks:")[0] + "validation:" + settings.partition("validation:")[2]
    kept = re.sub(r"  - mkdocstrings:.*?(?=\n\S|\Z)", "", kept.partition("nav:")[0], flags=re.DOTALL)
    (tmp_path / "mkdocs.yml").write_text(kept)
    command = [sys.executable, "-m", "mkdocs", "build", "--strict"]
    built = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert built.returncode == 1
    assert f"'{link}'" in built.stderr
