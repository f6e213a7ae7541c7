"""What a gate says, as JUnit's XML and Markdown say it to other programs."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from nathlon.arena.decision import Decision
from nathlon.results.gate import GateFinding, GateReport
from nathlon.results.words import percent
from nathlon.sim.whole_file import write_whole

MARKS = {Decision.PASS: "✓ pass", Decision.FAIL: "✗ fail", Decision.CANNOT_TELL: "? cannot tell"}


def junit(report: GateReport) -> bytes:
    """The report as JUnit XML: a suite for each candidate, a case for each measure.

    What cannot be told is an error, what was not asked is skipped.
    """
    root = ElementTree.Element("testsuites", name="nathlon gate")
    for candidate in report.candidates:
        suite = ElementTree.SubElement(root, "testsuite", name=f"{candidate.name} against {report.champion}")
        counts = dict.fromkeys(("failures", "errors", "skipped"), 0)
        for finding in candidate.findings:
            case = ElementTree.SubElement(
                suite, "testcase", classname=candidate.name, name=finding.measure, time="0"
            )
            if finding.set_aside is not None:
                kind, tag = "skipped", "skipped"
            elif finding.verdict == Decision.FAIL:
                kind, tag = "failures", "failure"
            elif finding.verdict == Decision.CANNOT_TELL:
                kind, tag = "errors", "error"
            else:
                ElementTree.SubElement(case, "system-out").text = finding.sentence
                continue
            counts[kind] += 1
            told = ElementTree.SubElement(case, tag, message=finding.sentence)
            if tag != "skipped":
                told.set("type", finding.verdict)
        ElementTree.SubElement(suite, "system-out").text = "\n".join([report.headline, *report.remarks])
        suite.set("tests", str(len(candidate.findings)))
        for kind, count in counts.items():
            suite.set(kind, str(count))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)


def markdown(report: GateReport) -> str:
    """The report for a pull request or the summary of a CI job."""
    lines = [f"### {MARKS[report.verdict]}: {escaped(report.headline)}", ""]
    if report.remarks:
        lines += [escaped(" ".join(report.remarks)), ""]
    for candidate in report.candidates:
        lines += [
            f"**{escaped(candidate.name)}** against {escaped(report.champion)}",
            "",
            "| measure | verdict | difference | bounds | may be | units |",
            "| --- | --- | ---: | ---: | ---: | ---: |",
        ]
        lines += ["| " + " | ".join(map(escaped, cells(finding))) + " |" for finding in candidate.findings]
        lines += ["", *(f"- {escaped(note)}" for note in candidate.notes), ""]
    lines.append(
        f"{report.races:,} races in {report.wall_s:.0f} s, seed {report.seed}. "
        f"A candidate that is worse by a margin passes with probability {percent(report.alpha)} at most."
    )
    return "\n".join(lines) + "\n"


def cells(finding: GateFinding) -> tuple[str, ...]:
    """A finding as a row: measure, verdict, difference, bounds, margin, units."""
    if finding.set_aside is not None:
        return finding.measure, f"not asked: {finding.set_aside}", "", "", "", ""

    def number(value: float | None) -> str:
        return "" if value is None else f"{value:+z.3g}"

    if finding.margin is None:
        found = "" if finding.difference is None else f"{finding.difference:g}"
        return finding.measure, MARKS[finding.verdict], found, "", "", f"{finding.units:,}"
    return (
        f"{finding.measure} {finding.unit}",
        MARKS[finding.verdict],
        number(finding.difference),
        finding.bounds,
        number(-finding.margin),
        f"{finding.units} of {finding.most}",
    )


def escaped(text: str) -> str:
    """Text that Markdown takes as it is, also in a table."""
    return "".join(f"\\{sign}" if sign in "\\`*_{}[]<>()#|!" else sign for sign in text)


def write_gate(report: GateReport, folder: Path) -> None:
    """Write `gate.json`, `junit.xml` and `gate.md` to a folder."""
    files = {
        "gate.json": report.model_dump_json(indent=1).encode(),
        "junit.xml": junit(report),
        "gate.md": markdown(report).encode(),
    }
    for name, content in files.items():
        write_whole(folder / name, content)
