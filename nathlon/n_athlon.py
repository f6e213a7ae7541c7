"""The second stage: survivors of the filter through every skill test, and who is shortlisted."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
import polars as pl

from arena.entrant import Entrant
from arena.match import Match
from arena.results import BATTERY, SKILLS
from nathlon.battery import MEASURES, rank_battery, skills
from nathlon.run import Answer, Run
from nathlon.skill import Skill, measure_runs, shipped_skills
from nathlon.trials import against, draw_seeds


def run_battery(run: Run, entrants: Sequence[Entrant], shortlist: int) -> Answer:
    """Test all entrants and keep the `shortlist` of them with the most points."""
    began = time.perf_counter()
    planned = skill_matches(entrants, shipped_skills(), run.seeds("battery"))
    results = run.results("battery", [match for _, _, match in planned])
    marks = [
        measure_runs(skill, entrant.id, results.filter(pl.col("match") == match.key))
        for skill, entrant, match in planned
    ]
    measures = pl.concat(marks) if marks else pl.DataFrame(schema=MEASURES)
    if measures.is_empty():
        tables = {"skills": pl.DataFrame(schema=SKILLS), "battery": pl.DataFrame(schema=BATTERY)}
    else:
        tables = {
            "skills": skills(measures, run.rng("battery")),
            "battery": rank_battery(measures, run.rng("battery"), shortlist),
        }
    kept = set(tables["battery"].filter("shortlisted")["entrant"])
    shortlisted = [entrant for entrant in entrants if entrant.id in kept]
    run.note("battery", len(entrants), len(shortlisted), results, began)
    return Answer(tables, shortlisted, results)


def skill_matches(
    entrants: Sequence[Entrant], skills: Sequence[Skill], seeds: np.random.SeedSequence
) -> list[tuple[Skill, Entrant, Match]]:
    """Every entrant through every skill test, with the same seeds for all."""
    matches = []
    for skill, stream in zip(skills, seeds.spawn(len(skills)), strict=True):
        drawn = draw_seeds(stream, skill.runs)
        for entrant in entrants:
            match = against(
                "battery", skill.name, skill.scenario, entrant, skill.opponents, skill.slots, drawn
            )
            matches.append((skill, entrant, match))
    return matches
