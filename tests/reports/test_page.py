from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from playwright.sync_api import Browser, expect

from nathlon.reports.page import render, write_page
from nathlon.results.ranks import written_rank
from nathlon.results.selection import Selection
from tests.support.lap_tables import RADIUS_M
from tests.support.opened_page import Opened, full_night, key, views
from tests.support.selections import PERSON, TESTS, build, card, ranked, with_tables

HOSTILE = "</script><script>document.title='owned'</script><img src=x onerror=document.title='owned'>"


@pytest.fixture(scope="module")
def full() -> Selection:
    return full_night()


def _ranges(table: pl.DataFrame) -> dict[str, str]:
    """The ranks of a table by entrant, as they are written."""
    return {
        entrant: written_rank(*both)
        for entrant, *both in table.select("entrant", "rank", "worst_rank").rows()
    }


def test_tonight_tells_the_decision_and_what_changed(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    opened = Opened(browser, full, tmp_path)
    ranking = full.named("ranking")
    text = opened.page.locator("main").inner_text()
    assert opened.page.locator("h1").inner_text() == f"Send {ranking['name'][0]}"
    assert f"ann, “{PERSON[1]}”" in text
    assert "Sent in night-0001\ncoast-old" in text
    assert "Newcomers\n1, 1 through the filter" in text
    ranks = _ranges(ranking)
    assert f"New in the pool: {ranking['name'][0]} (rank {ranks[ranking['entrant'][0]]})" in text
    assert full.previous is not None
    before = dict(full.previous.pool.select("entrant", "rank").iter_rows())
    moved = [row for row in ranking[1:].to_dicts() if before[row["entrant"]] != row["rank"]]
    moves = opened.page.locator(".moves li").all_inner_texts()
    assert len(moves) == len(moved) > 0
    former = _ranges(full.previous.pool)
    first = moved[0]["entrant"]
    assert any(f"{former[first]} → {ranks[first]}" in move for move in moves)
    assert "chicane in traffic was not held: harbour has no chicane" in text
    assert "broken.safetensors not a checkpoint" in text
    links = {a.inner_text(): a.get_attribute("href") for a in opened.page.locator("section a").all()}
    assert links["What policies printed"] == "../policies.log"
    assert links["watch it here"] == "../replays/final.html"
    assert links["recording, for Foxglove and Rerun"] == "javascript%3Aalert(1)%3B'%24(x).mcap"
    opened.assert_quiet()


def test_leaderboard_shows_the_tables_and_keeps_its_state(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    opened = Opened(browser, full, tmp_path, "#/leaderboard")
    ranking = full.named("ranking")
    row = ranking.row(0, named=True)
    assert opened.names("leaderboard") == ranking.sort("rank", maintain_order=True)["name"].to_list()
    assert f"{row['points_low']:.1f} to {row['points_high']:.1f}" in opened.column("leaderboard", 4)[0]
    ranks = list(_ranges(ranking.sort("rank", maintain_order=True)).values())
    assert opened.column("leaderboard", 2) == ranks
    assert re.fullmatch(r"1 to \d", ranks[0])
    assert opened.page.locator("#leaderboard .whisker").count() == 2 * ranking.height
    by_rate = ranking.sort("contacts_per_km")["name"].to_list()
    head = opened.page.get_by_role("button", name="Contacts per km")
    head.click()
    assert opened.names("leaderboard") == by_rate
    assert opened.page.locator("#leaderboard th[aria-sort=ascending]").inner_text() == "Contacts per km"
    head.press("Enter")
    assert opened.names("leaderboard") == by_rate[::-1]
    opened.page.get_by_label("Filter Leaderboard").fill(by_rate[0].upper())
    assert opened.names("leaderboard") == by_rate[:1]
    assert opened.page.evaluate("location.hash").startswith("#/leaderboard?sort=-contacts&q=COAST")
    opened.page.reload()
    assert opened.names("leaderboard") == by_rate[:1]
    opened.page.get_by_label("Filter Leaderboard").fill("")
    assert opened.names("leaderboard") == by_rate[::-1]
    opened.assert_quiet()


def test_a_mixed_cluster_is_told(browser: Browser, tmp_path: Path) -> None:
    selection = build(np.random.default_rng(5))
    kinds = {"znver4-1f3a": 120, "haswell-0476": 3}
    summary = selection.summary.model_copy(update={"processors": kinds})
    opened = Opened(browser, replace(selection, summary=summary), tmp_path, "#/tonight")
    assert "znver4-1f3a 120 matches, haswell-0476 3 matches" in opened.page.locator("main").inner_text()
    opened.assert_quiet()


def test_absent_numbers_sort_last_either_way(browser: Browser, tmp_path: Path) -> None:
    rows = [ranked(card(i, "")["entrant"], i + 1, 20.0 - i) for i in range(3)]
    rows[1] |= {"contacts_per_km": None, "contacts_low": None, "contacts_high": float("nan")}
    selection = with_tables({"entrants": [card(i, f"e{i}") for i in range(3)], "ranking": rows})
    opened = Opened(browser, selection, tmp_path, "#/leaderboard")
    head = opened.page.get_by_role("button", name="Contacts per km")
    for _ in range(2):
        head.click()
        assert opened.names("leaderboard")[-1] == "e1"
    opened.assert_quiet()


def test_links_lead_from_the_leaderboard_to_a_race(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = Opened(browser, full, tmp_path, "#/leaderboard")
    page, first = opened.page, full.named("ranking").row(0, named=True)
    match = full.results["match"][0]
    page.locator("#leaderboard").get_by_role("link", name=first["name"]).click()
    expect(page.locator("h1")).to_have_text(first["name"])
    assert f"rank {_ranges(full.named('ranking'))[first['entrant']]}" in page.locator(".funnel").inner_text()
    assert "in the time trials" in page.locator(".funnel").inner_text()
    assert set(opened.column("own-races", 2)) == {"Round robin", "Pareto filter"}
    assert set(opened.column("own-races", 3)) == {"", *full.named("ranking")["name"][1:]}
    races = full.results.filter(pl.col("entrant") == first["entrant"])
    assert len(opened.column("own-races", 1)) == races.height == 41
    page.locator("#own-races a").last.click()
    expect(page.locator("h1")).to_have_text(f"Race {match[:12]}/0")
    race = full.results.filter((pl.col("match") == match) & (pl.col("race") == 0))
    names = dict(full.tables["entrants"].select("entrant", "name").iter_rows())
    assert opened.names("result") == [names[entrant] for entrant in race.sort("place")["entrant"]]
    sides = race.group_by("team").agg(pl.col("points").sum()).sort("team")["points"].to_list()
    for points in sides:
        assert f" {points:.0f}" in page.locator(".why").inner_text()
    assert page.locator("pre").inner_text() == f"nathlon replay nathlon.sqlite {match[:12]}:0"
    page.go_back()
    assert page.locator("h1").inner_text() == first["name"]
    opened.assert_quiet()


def test_two_are_compared(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = Opened(browser, full, tmp_path, "#/leaderboard")
    page, rows = opened.page, full.named("ranking").to_dicts()
    for row in rows[:3]:
        page.get_by_label(f"Compare {row['name']}", exact=True).check()
    assert page.locator(".pick input:checked").count() == 2
    page.get_by_role("link", name=f"Compare {rows[1]['name']} and {rows[2]['name']}").click()
    ranks = page.locator(".sides tbody tr").nth(1).locator("strong").all_inner_texts()
    assert ranks == [written_rank(row["rank"], row["worst_rank"]) for row in rows[1:3]]
    cells = page.locator(".sides tbody tr").nth(2).locator("td").all_inner_texts()
    points = [row["points_per_race"] for row in rows[1:3]]
    assert [cell.split()[0] for cell in cells[:2]] == [f"{value:.1f}" for value in points]
    assert cells[2].strip() == f"{points[0] - points[1]:+.1f}"
    told = {
        row[0]: row[1:]
        for row in (tr.inner_text().split("\t") for tr in page.locator(".sides tbody tr").all())
    }
    assert told["Round robin"] == []
    skills = full.tables["skills"].filter(pl.col("test") == TESTS[1])
    first, second = (
        skills.row(by_predicate=pl.col("entrant") == row["entrant"], named=True) for row in rows[1:3]
    )
    lower, upper = (  # as of two independent estimates with intervals of 4 either side
        first["points"] - second["points"] + side * np.hypot(4, 4) for side in (-1, 1)
    )
    assert f"{lower:.0f} to {upper:.0f}".replace("-", "−") in told["race eight"][2]
    better = rows[1]["name"] if lower > 0 else rows[2]["name"] if upper < 0 else "not told apart"
    assert told["race eight"][3] == better
    page.get_by_role("link", name="Their races").click()
    assert len(opened.column("races", 1)) == 2
    each = [sum(map(int, cell.split(":"))) for cell in opened.column("races", 7)]
    page.locator("#races a").first.click()
    assert page.locator("dt:text-is('Contacts') + dd").inner_text().startswith(str(each[0] // 2))
    assert sum(map(int, opened.column("result", 8))) == each[0]
    opened.assert_quiet()


def test_pareto_draws_what_is_chosen(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = Opened(browser, full, tmp_path, "#/pareto")
    opened.go("#/pareto")
    field = full.tables["pareto"]
    marks = opened.page.locator("figure g[data-mark=dot]").locator("circle, path")
    assert marks.count() == field.drop_nulls("lap_s").height < field.height
    assert len(opened.column("pareto", 1)) == 200
    opened.page.get_by_role("button", name="Show all 250").click()
    assert len(opened.column("pareto", 1)) == field.height
    opened.page.get_by_label("Across").select_option("contacts_per_km")
    assert opened.page.evaluate("location.hash") == "#/pareto?x=contacts_per_km"
    opened.until("document.querySelectorAll('figure g[data-mark=dot] :is(circle, path)').length === 250")
    marks.last.scroll_into_view_if_needed()
    box = marks.last.bounding_box()
    assert box is not None
    opened.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    opened.page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    opened.page.wait_for_url("**#/checkpoint/*")
    opened.assert_quiet()


def test_shares_are_in_per_cent_and_objectives_say_where_they_are_from(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    opened = Opened(browser, full, tmp_path, "#/pareto?sort=off_course_share")
    heads = opened.page.locator("#pareto thead button").all_inner_texts()
    place = heads.index("Off course, %")
    hint = opened.page.get_by_role("button", name="Off course, %").get_attribute("title")
    assert hint == "In the filter's races"
    least = full.tables["pareto"]["off_course_share"].min()
    assert isinstance(least, float)
    assert opened.column("pareto", place + 1)[0] == f"{100 * least:.2f}"
    note = opened.page.locator("section .note").first.inner_text()
    assert "Off course, %; Contacts per km: in the filter's races." in note
    opened.go(f"#/checkpoint/{key(full, 0)}")
    assert "in the filter's races" in opened.page.locator(".funnel").inner_text()
    opened.go("#/leaderboard")
    assert "Points and contacts: in the round robin." in opened.page.locator(".note").first.inner_text()
    opened.assert_quiet()


def test_a_test_says_how_many_of_its_runs_failed(browser: Browser, tmp_path: Path, full: Selection) -> None:
    first, second = full.named("battery").sort("rank", maintain_order=True)["entrant"][:2]
    hot_lap = TESTS.index("hot_lap")
    for failed, told in (
        ({first: 2}, ["2 of 24 failed and have 0 points; mean mark", "none failed"]),
        (None, ["of the runs that set one"] * 2),
    ):
        marks = full.summary.marks | {
            "hot_lap": full.summary.marks["hot_lap"].model_copy(update={"failed": failed})
        }
        summary = full.summary.model_copy(update={"marks": marks})
        opened = Opened(browser, replace(full, summary=summary), tmp_path, "#/n-athlon")
        names = opened.names("n-athlon")
        for entrant, words in zip((first, second), told, strict=True):
            name = full.tables["entrants"].filter(entrant=entrant)["name"][0]
            row = opened.page.locator("#n-athlon tbody tr").nth(names.index(name))
            assert words in (row.locator(".cell").nth(hot_lap).get_attribute("title") or "")
        opened.assert_quiet()


def test_n_athlon_and_matchups_show_their_tables(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = Opened(browser, full, tmp_path, "#/n-athlon")
    skills = full.tables["skills"]
    assert opened.page.locator("#n-athlon .cell").count() == skills.height
    opened.go("#/n-athlon")
    assert opened.page.locator("figure g[data-mark=dot] > *").count() == 2 * len(TESTS)
    best = skills.filter(pl.col("test") == TESTS[1]).sort("points")["entrant"][-1]
    opened.page.get_by_role("button", name="race eight").click()
    names = dict(full.tables["entrants"].select("entrant", "name").iter_rows())
    assert opened.names("n-athlon")[0] == names[best]
    assert opened.page.locator("main").inner_text().count("harbour has no chicane") == 1
    hint = opened.page.get_by_role("button", name="hot lap").get_attribute("title")
    assert hint == "The best of four laps alone. Measured in s; less is better."
    assert "The best of four laps alone." in opened.page.locator("main").inner_text()
    (course,) = opened.page.locator(".stretches figure").all()
    assert course.inner_text().split("\n") == ["grid start", "from −60 m to 480 m"]
    whole, held = (
        course.locator(f".{kind}").evaluate("path => path.getTotalLength()") for kind in ("lap", "held")
    )
    assert held / whole == pytest.approx(540.0 / (2.0 * np.pi * RADIUS_M), rel=0.03)
    opened.go("#/matchups")
    assert opened.page.locator("#matchups .cell").count() == full.tables["matchups"].height == 30
    decided = ((pl.col("difference_low") > 0) | (pl.col("difference_high") < 0)).sum()
    bold = opened.page.locator("#matchups .decided").count()
    assert 0 < bold == full.tables["matchups"].select(decided).item() < 30
    opened.page.locator("#matchups .cell a").first.click()
    opened.page.locator("#races tbody tr").first.wait_for()
    assert len(opened.column("races", 1)) == 2
    opened.assert_quiet()


def test_committee_is_told_with_names_reasons_and_times(
    browser: Browser, tmp_path: Path, full: Selection
) -> None:
    opened = Opened(browser, full, tmp_path, "#/committee")
    ballots = opened.page.locator(".ballots li").all_inner_texts()
    assert len(ballots) == 3
    assert all(text in ballots[1] for text in ("ann", "2031-05-04 03:21 UTC", PERSON[1], "Approves coast-"))
    assert opened.page.locator(".standings .chosen").count() == 6 + 1
    opened.assert_quiet()


def test_blind_drives_are_told_with_answers_and_recordings(browser: Browser, tmp_path: Path) -> None:
    selection = build(np.random.default_rng(2), entrants=40, finalists=4)
    [shortlist, sent] = selection.summary.committee
    first, second = (standing.entrant for standing in sent.standings[:2])
    scores = {"again": 4, "fair": 3, "room": 2, "beatable": 1}
    drive = {
        "member": "ann", "at": "2031-05-04T03:21:00.000000+00:00", "text": HOSTILE, "better": second,
        "recording": "drives/races/0123456789-0.mcap",
        "answers": [
            {"entrant": first, "letter": "B", **scores}, {"entrant": second, "letter": "A", **scores},
        ],
        "moments": [{"time_s": 12.34, "lap_m": 500.0, "nearest": first, "apart_m": 4.0}],
    }  # fmt: skip
    asked = (shortlist, sent.model_copy(update={"drives": (drive,)}))
    driven = replace(selection, summary=selection.summary.model_copy(update={"committee": asked}))
    opened = Opened(browser, driven, tmp_path, "#/committee")
    table = opened.page.locator("table.standings").last
    rows = table.locator("tbody tr").all_inner_texts()
    names = [standing.name for standing in sent.standings[:2]]
    assert rows[0].split() == ["B:", names[0], "4", "3", "2", "1", "ann"]
    assert rows[1].split() == ["A:", names[1], "4", "3", "2", "1", "ann", "preferred"]
    last = opened.page.locator(".ballots li").last
    assert f"Marked 12.3 s near {names[0]}." in last.inner_text()
    assert HOSTILE in last.inner_text()
    link = last.get_by_role("link", name="recording")
    assert link.get_attribute("href") == "../drives/races/0123456789-0.mcap"
    opened.picture("committee-drives")
    opened.assert_quiet()


def test_hostile_names_are_text(browser: Browser, tmp_path: Path) -> None:
    selection = build(np.random.default_rng(2), entrants=40, finalists=4)
    entrants = selection.tables["entrants"].with_columns(
        name=pl.format("{} {}", pl.lit(HOSTILE), pl.int_range(pl.len())), source=pl.lit('" onmouseover="x')
    )
    hostile = replace(
        selection,
        title=HOSTILE,
        tables={**selection.tables, "entrants": entrants},
        summary=selection.summary.model_copy(
            update={"circuit": HOSTILE, "tests_set_aside": {HOSTILE: HOSTILE}}
        ),
    )
    opened = Opened(browser, hostile, tmp_path)
    assert opened.page.title() == HOSTILE
    for address in views(hostile):
        opened.go(address)
        assert opened.page.locator("img, [onmouseover]").count() == 0
        assert opened.page.title() != "owned"
    assert HOSTILE in opened.page.locator("h1").inner_text()
    opened.assert_quiet()


@pytest.mark.parametrize(
    ("finalists", "laps", "entrants"),
    [(1, 1.0, 1), (0, 0.0, 3), (0, 0.9, 30), (1, 0.9, 30)],
    ids=["one entrant", "nobody finished a lap", "nobody shortlisted", "one finalist"],
)
def test_small_selections(
    browser: Browser, tmp_path: Path, finalists: int, laps: float, entrants: int
) -> None:
    selection = build(np.random.default_rng(4), entrants, finalists, laps)
    opened = Opened(browser, selection, tmp_path)
    for address in ("leaderboard", "pareto", "n-athlon", "matchups", "committee"):
        opened.go(f"#/{address}")
    opened.go("#/leaderboard")
    assert opened.page.locator("#leaderboard tbody tr").count() == finalists
    opened.assert_quiet()


def test_nothing_at_all(browser: Browser, tmp_path: Path) -> None:
    facts: dict[str, Any] = {"pair_correlation": None, "stages": [], "versions": {}, "marks": {}}
    empty = replace(with_tables({}, **facts), under_way="under way: pareto, 3 of 7 matches")
    opened = Opened(browser, empty, tmp_path)
    assert opened.page.locator("h1").inner_text() == "Nobody to send yet"
    assert "3 of 7 matches" in opened.page.locator("main").inner_text()
    for address in ("leaderboard", "pareto", "n-athlon", "matchups", "committee"):
        opened.go(f"#/{address}")
        assert opened.page.locator(".empty").count() > 0
    opened.go("#/checkpoint/unknown")
    assert opened.page.locator("h1").inner_text() == "Not found"
    opened.assert_quiet()


def test_without_scripts_the_verdict_is_there(browser: Browser, tmp_path: Path, full: Selection) -> None:
    opened = Opened(browser, full, tmp_path, java_script_enabled=False)
    assert opened.page.locator("h1").inner_text().startswith("Send coast-")
    assert "ranking.xlsx" in opened.page.locator("main").inner_text()
    opened.assert_quiet()


def test_same_selection_same_bytes_and_small_enough() -> None:
    first = render(build(np.random.default_rng(5), entrants=3000))
    assert first == render(build(np.random.default_rng(5), entrants=3000))
    assert len(first.encode()) < 3_000_000


def test_failed_render_leaves_the_old_page(tmp_path: Path) -> None:
    selection = build(np.random.default_rng(5))
    before = write_page(selection, tmp_path).read_bytes()
    with pytest.raises(KeyError):
        write_page(replace(selection, tables={}), tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["index.html"]
    assert (tmp_path / "index.html").read_bytes() == before
