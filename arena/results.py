"""The tables that stages hand to each other and to the reports, as typed polars frames."""

from __future__ import annotations

import polars as pl

ENDINGS = (
    "finished",
    "time_up",
    "stuck",
    "policy_raised",
    "illegal_action",
    "timed_out",
    "simulator_fault",
    "interrupted",
)
"""How a car's run can end. `time_up` means that the scenario ended while the car was still driving."""

POLICY_FAULTS = ("policy_raised", "illegal_action", "timed_out")
"""Endings by the policy's own fault, which score last. An illegal action is not finite or of the wrong
shape; a policy that has not answered within its time has timed out."""

VOID_ENDINGS = ("simulator_fault", "interrupted")
"""Endings that void the race, and with it the mirrored pair: nobody is to blame who raced."""

RESULTS = pl.Schema(
    {
        "match": pl.String,  # key of the match: hash of all that decides it
        "stage": pl.String,  # pareto, battery, tournament, race
        "test": pl.String,  # scenario name
        "race": pl.Int64,  # index of the race in its match
        "seed": pl.Int64,
        "mirrored": pl.Boolean,  # the second race of a mirrored pair
        "car": pl.Int64,  # index of the car in the race
        "slot": pl.Int64,  # starting place, 1 is pole
        "entrant": pl.String,  # entrant id
        "team": pl.Int64,  # 0 or 1; -1 without teams
        "place": pl.Int64,  # finishing place, 1 is first
        "points": pl.Float64,  # 10 8 6 5 4 3 2 1 by place
        "laps": pl.Int64,  # laps completed
        "ending": pl.String,  # one of ENDINGS
        "race_time_s": pl.Float64,  # with penalties not served; null where not finished
        "driven_s": pl.Float64,  # time until the run's ending
        "distance_m": pl.Float64,  # along the centre line from the start
        "best_lap_s": pl.Float64,  # null without a flying lap
        "off_course_s": pl.Float64,
        "wall_s": pl.Float64,
        "contacts": pl.Int64,  # contact events with other cars
        "contacts_faster_behind": pl.Int64,  # of these, while being behind and faster
        "contacts_at_fault": pl.Int64,  # of these, those that the stewards lay to this car
        "penalties": pl.Int64,
    }
)

ENTRANTS = pl.Schema(
    {
        "entrant": pl.String,  # SHA-256 of a checkpoint's bytes, or `driver:...`
        "name": pl.String,  # short, unique in a run
        "source": pl.String,  # path as given by the user
        "algorithm": pl.String,
        "circuit": pl.String,
        "car": pl.String,
        "step": pl.Int64,  # training step; null for the built-in driver
        "seed": pl.Int64,
    }
)

PARETO = pl.Schema(
    {
        "entrant": pl.String,
        "lap_s": pl.Float64,  # mean of best laps; null where no lap was completed
        "off_course_share": pl.Float64,  # of the time driven
        "contacts_per_km": pl.Float64,
        "nondominated_probability": pl.Float64,  # bootstrap
        "survives": pl.Boolean,
        "races": pl.Int64,
    }
)

SKILLS = pl.Schema(
    {
        "entrant": pl.String,
        "test": pl.String,
        "measure": pl.Float64,  # mean over runs, in `unit`
        "unit": pl.String,
        "points": pl.Float64,  # mean over runs
        "points_low": pl.Float64,  # 95 % bootstrap interval of the mean
        "points_high": pl.Float64,
        "runs": pl.Int64,
    }
)

BATTERY = pl.Schema(
    {
        "entrant": pl.String,
        "points": pl.Float64,  # sum over tests
        "points_low": pl.Float64,
        "points_high": pl.Float64,
        "rank": pl.Int64,  # 1 + entrants whose points_low lies above my points_high; ties share it
        "shortlisted": pl.Boolean,
    }
)

RANKING = pl.Schema(
    {
        "entrant": pl.String,
        "rank": pl.Int64,  # 1 + entrants whose low lies above my high; ties share it
        "points_per_race": pl.Float64,  # team points a race, least squares on pair differences
        "points_low": pl.Float64,  # 95 % bootstrap interval over mirrored pairs
        "points_high": pl.Float64,
        "contacts_per_km": pl.Float64,  # a car
        "contacts_low": pl.Float64,
        "contacts_high": pl.Float64,
        "pairs": pl.Int64,  # mirrored pairs raced
        "races": pl.Int64,
        "faults": pl.Int64,  # car runs that ended by the policy's fault
    }
)

MATCHUPS = pl.Schema(
    {
        "entrant": pl.String,
        "opponent": pl.String,
        "pairs": pl.Int64,
        "points_per_race": pl.Float64,  # team points of `entrant`
        "difference": pl.Float64,  # team points of entrant minus opponent, a race
        "difference_low": pl.Float64,
        "difference_high": pl.Float64,
        "contacts_per_km": pl.Float64,  # of entrant's cars
    }
)

TABLES: dict[str, pl.Schema] = {
    "entrants": ENTRANTS,
    "pareto": PARETO,
    "skills": SKILLS,
    "battery": BATTERY,
    "ranking": RANKING,
    "matchups": MATCHUPS,
}
"""The stage tables by name; results are kept by match and stand apart."""
