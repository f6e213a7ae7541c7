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


def test_no_line_is_too_long_to_read() -> None:
    lines = (
        (page, number, len(line))
        for page in PAGES
        for number, line in enumerate(page.read_text("utf-8").splitlines(), 1)
    )
    assert [f"{page}:{number}" for page, number, length in lines if length > LONGEST] == []


def test_links_to_files_lead_somewhere() -> None:
    """Also where mkdocs does not look: files of the repository that are not on the site."""
    generated = {"command-line.md", "bundled.md", "changes.md", "contributing.md"}
    dead = []
    for page in PAGES:
        text = re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.DOTALL)
        for target in re.findall(r"\]\(([^()#\s]+)(?:#[^()\s]*)?\)", text):
            if "://" not in target and Path(target).name not in generated:
                dead += [] if (page.parent / target).exists() else [f"{page}: {target}"]
    assert dead == []


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
def test_dead_links_fail_the_build(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    from mkdocs.commands.build import build
    from mkdocs.config import load_config
    from mkdocs.exceptions import Abort

    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text("# Home\n\n[one](nowhere.md) [two](training.md#nowhere)\n")
    (tmp_path / "docs" / "training.md").write_text("# Training\n")
    settings = (ROOT / "mkdocs.yml").read_text("utf-8")
    kept = settings.partition("hooks:")[0] + "validation:" + settings.partition("validation:")[2]
    kept = re.sub(r"  - mkdocstrings:.*?(?=\n\S|\Z)", "", kept.partition("nav:")[0], flags=re.DOTALL)
    (tmp_path / "mkdocs.yml").write_text(kept)
    with pytest.raises(Abort):
        build(load_config(str(tmp_path / "mkdocs.yml"), strict=True))
    for link in ("nowhere.md", "training.md#nowhere"):
        assert f"'{link}'" in caplog.text
