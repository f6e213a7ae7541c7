"""The table of a league's generations, as CSV and JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import polars as pl

from nathlon.lab.league.generation import Generation
from nathlon.sim.whole_file import whole_file, write_whole, writing

GENERATIONS = pl.Schema(
    {
        "generation": pl.Int64,  # from 0, the first entrants
        "name": pl.String,
        "rank": pl.Int64,  # 1 + entrants that are better in this generation; ties share it
        "points_per_race": pl.Float64,  # team points, as `nathlon.arena.results.RANKING`
        "points_low": pl.Float64,
        "points_high": pl.Float64,
        "contacts_per_km": pl.Float64,  # a car
        "contacts_low": pl.Float64,
        "contacts_high": pl.Float64,
        "at_fault_per_km": pl.Float64,  # those that the stewards lay to the car
        "at_fault_low": pl.Float64,
        "at_fault_high": pl.Float64,
        "penalties": pl.Float64,  # a car and race
        "races": pl.Int64,
        "newcomer": pl.Boolean,  # what this generation has made
        "parent": pl.Boolean,  # to be polished next, or to be sent
        "kept": pl.Boolean,  # in the population from now on
        "weight": pl.Float64,  # how often it is drawn as an opponent of the next generation
        "entrant": pl.String,
        "source": pl.String,
    }
)
"""A row for each member of each generation, the best of each first."""
CSV, JSON = "generations.csv", "generations.json"


def table(generations: Sequence[Generation]) -> pl.DataFrame:
    """GENERATIONS of a league so far."""
    rows = [
        {
            "generation": made.number,
            **member.model_dump(exclude={"bradley_terry"}),
            "newcomer": member.entrant == made.newcomer,
            "parent": member.entrant == made.parent,
        }
        for made in generations
        for member in made.members
    ]
    return pl.DataFrame(rows, schema=GENERATIONS)


def write_table(folder: Path, generations: Sequence[Generation]) -> None:
    """Replace the table of a league in its folder.

    Raises:
        InputError: if it cannot be written.
    """
    told = table(generations)
    with writing(folder):
        with whole_file(folder / CSV) as partial:
            told.write_csv(partial)
        write_whole(folder / JSON, json.dumps(told.to_dicts(), indent=1) + "\n")
