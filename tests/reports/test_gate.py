"""What a gate leaves: exit codes, JUnit read by an independent parser, Markdown, and a page in a browser."""

from __future__ import annotations

from pathlib import Path
from xml.dom import minidom

import pytest
from playwright.sync_api import Browser

from nathlon.arena.decision import Decision
from nathlon.reports.gate import cells, junit, markdown
from nathlon.reports.gate_page import MARGINS, WIDTH, place, write_gate_page
from nathlon.results.gate import Gated, GateFinding, GateReport

PASSED = GateFinding(
    measure="points", unit="a race", margin=2.0, difference=-0.5, low=-1.5, high=0.5, units=32, most=96,
    verdict=Decision.PASS,
)  # fmt: skip
FAILED = GateFinding(
    measure="lap time", unit="in %", margin=0.5, difference=-1.2, low=-1.3, high=-1.1, units=8, most=64,
    verdict=Decision.FAIL,
)  # fmt: skip
OPEN = GateFinding(measure="chicane", unit="in points", margin=50.0, difference=-20.0, units=64, most=64)
ASIDE = GateFinding(
    measure="contacts", unit="per km", margin=0.05, set_aside="nothing of the kind is measured"
)


def report(*candidates: tuple[str, Decision, tuple[GateFinding, ...]]) -> GateReport:
    return GateReport(
        champion="champ|ion",
        champion_id="c",
        circuit="lindenring",
        car="gt3",
        world="racing",
        seed=1,
        alpha=0.05,
        beta=0.05,
        races=100,
        wall_s=12.3,
        versions={},
        candidates=tuple(
            Gated(name=name, entrant=name, verdict=verdict, findings=findings)
            for name, verdict, findings in candidates
        ),
    )


GOOD = ("good", Decision.PASS, (PASSED, ASIDE))
BAD = ("b<a>d", Decision.FAIL, (PASSED, FAILED))
UNSURE = ("unsure", Decision.CANNOT_TELL, (PASSED, OPEN))


@pytest.mark.parametrize(
    ("candidates", "code"), [([GOOD], 0), ([GOOD, UNSURE], 4), ([UNSURE, BAD], 1), ([GOOD, BAD], 1)]
)
def test_exit_codes(candidates: list[tuple[str, Decision, tuple[GateFinding, ...]]], code: int) -> None:
    assert report(*candidates).exit_code == code


def test_no_difference_has_no_sign_of_its_own() -> None:
    equal = PASSED.model_copy(update={"difference": -0.0})
    assert cells(equal)[2] == "+0"
    assert "a race: +0 (" in equal.sentence


def test_ci_reads_what_failed_and_why() -> None:
    suites = minidom.parseString(junit(report(GOOD, BAD, UNSURE))).getElementsByTagName("testsuite")
    counted = [
        tuple(int(suite.getAttribute(name)) for name in ("tests", "failures", "errors", "skipped"))
        for suite in suites
    ]
    assert counted == [(2, 0, 0, 1), (2, 1, 0, 0), (2, 0, 1, 0)]
    [failure] = suites[1].getElementsByTagName("failure")
    assert failure.getAttribute("message") == FAILED.sentence
    assert suites[1].getAttribute("name") == "b<a>d against champ|ion"


def test_a_summary_is_one_table_a_candidate_whatever_the_names() -> None:
    lines = markdown(report(BAD)).splitlines()
    rows = [line for line in lines if line.startswith("|")]
    assert {row.replace("\\|", "").count("|") for row in rows} == {7}
    assert "b\\<a\\>d" in lines[0]


def test_findings_lie_on_the_axis_in_margins() -> None:
    assert place(0) == WIDTH / 2
    assert place(-MARGINS) == place(-100) == 0
    assert place(100) == WIDTH


def test_the_page_shows_every_measure_and_loads_nothing(browser: Browser, tmp_path: Path) -> None:
    path = write_gate_page(report(GOOD, BAD, UNSURE), tmp_path)
    page = browser.new_page()
    asked, said = [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: said.append(message.text))
    page.goto(path.as_uri())
    assert page.locator("tbody tr").count() == 6
    assert page.locator("h2").all_inner_texts() == ["good: pass", "b<a>d: fail", "unsure: cannot tell"]
    bars = page.locator("line.bar.fail")
    limit = page.locator("line.limit").nth(2)
    assert float(bars.get_attribute("x2") or 0) < float(limit.get_attribute("x1") or 0)
    assert asked == [path.as_uri()]
    assert said == []
    page.close()
