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
"""Endings by the policy's own fault, which score last. An illegal action is not finite, or the answer has
another shape or type than the contract's; a policy that has not answered, or could not be loaded, within
its time has timed out."""

INTERRUPTED = "interrupted"
"""Ending of what may have been stopped by the machine: the match is run again."""

VOID_ENDINGS = ("simulator_fault", INTERRUPTED)
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
        "team": pl.Int64,  # 0 or 1; -1 without teams; in tests 0 is who is tested; -2 makes up the numbers
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
        "score": pl.Float64,  # more is better; null where places alone count
        "measures": pl.String,  # the world's own, a JSON object of numbers; null without any
        "stints": pl.String,  # JSON, see `nathlon.arena.stints`; null of a car without a strategist
    }
)
"""What a world does not measure is null."""

ENTRANTS = pl.Schema(
    {
        "entrant": pl.String,  # SHA-256 of a checkpoint's bytes, or `driver:...`
        "name": pl.String,  # short, unique in a run
        "source": pl.String,  # path as given by the user, see nathlon.sim.names.written
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
        "lap_s": pl.Float64,  # mean best lap of the time trials; null where no lap was completed
        "off_course_share": pl.Float64,  # of the time driven in races; null where none was raced
        "contacts_per_km": pl.Float64,  # likewise
        "nondominated_probability": pl.Float64,  # over draws of what the objectives may truly be
        "survives": pl.Boolean,
        "races": pl.Int64,  # without time trials
    }
)

OBJECTIVES = pl.Schema(
    {
        "entrant": pl.String,
        "objective": pl.String,  # name in the configuration
        "source": pl.String,  # race or time_trial
        "value": pl.Float64,  # over all runs, in `unit`; null where nothing was measured
        "unit": pl.String,
        "goal": pl.String,  # min or max
        "runs": pl.Int64,
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
        "rank": pl.Int64,  # 1 + entrants that are better, after Holm's correction: the best that is possible
        "worst_rank": pl.Int64,  # that is possible: ahead of those only that it is better than
        "shortlisted": pl.Boolean,  # by the committee
    }
)

RANKING = pl.Schema(
    {
        "entrant": pl.String,
        "rank": pl.Int64,  # 1 + entrants that are better, after Holm's correction: the best that is possible
        "worst_rank": pl.Int64,  # that is possible: ahead of those only that it is better than
        "points_per_race": pl.Float64,  # of the entrant's cars, least squares on differences of units
        "points_low": pl.Float64,  # 95 % bootstrap interval over units
        "points_high": pl.Float64,
        "contacts_per_km": pl.Float64,  # a car
        "contacts_low": pl.Float64,
        "contacts_high": pl.Float64,
        "at_fault_per_km": pl.Float64,  # contacts that the stewards lay to the entrant's cars
        "at_fault_low": pl.Float64,
        "at_fault_high": pl.Float64,
        "barred": pl.Boolean,  # a rate's interval lies wholly above the gate's limit
        "pairs": pl.Int64,  # units raced: mirrored pairs, blocks of a free-for-all
        "races": pl.Int64,
        "faults": pl.Int64,  # car runs that ended by the policy's fault
    }
)

POOL_CELLS = pl.Schema(
    {
        "test": pl.String,
        "field": pl.String,  # all entrants of a unit, one a line
        "entrant": pl.String,
        "opponent": pl.String,  # the second by id
        "units": pl.Int64,
        "difference": pl.Float64,  # mean over the units: points of entrant minus opponent, a race
        "squares": pl.Float64,  # of the differences from their mean, summed over the units
        "points": pl.Float64,  # mean of all sides in these units
    }
)
"""What is kept of the round robins of all nights: enough to fit the pool as if all units were there."""

POOL_TOTALS = pl.Schema(
    {
        "entrant": pl.String,
        "units": pl.Int64,
        "races": pl.Int64,
        "faults": pl.Int64,  # car runs that ended by the policy's fault
        "contacts": pl.Int64,
        "at_fault": pl.Int64,
        "km": pl.Float64,  # a car
        "contacts_squared": pl.Int64,  # sums over units, as the next
        "at_fault_squared": pl.Int64,
        "km_squared": pl.Float64,
        "contacts_km": pl.Float64,
        "at_fault_km": pl.Float64,
    }
)

MATCHUPS = pl.Schema(
    {
        "entrant": pl.String,
        "opponent": pl.String,
        "pairs": pl.Int64,  # units
        "points_per_race": pl.Float64,  # team points of `entrant`
        "difference": pl.Float64,  # team points of entrant minus opponent, a race
        "difference_low": pl.Float64,
        "difference_high": pl.Float64,
        "contacts_per_km": pl.Float64,  # of entrant's cars
    }
)

RECORDS = pl.Schema(
    {
        "entrant": pl.String,
        "mean": pl.Float64,  # points of a side, a race that it took part in
        "mean_low": pl.Float64,  # bootstrap interval over units
        "mean_high": pl.Float64,
        "won": pl.Float64,  # share of these races in which nobody had as many points
        "drawn": pl.Float64,  # in which nobody had more, and somebody as many
        "lost": pl.Float64,
    }
)
"""What entrants came to in a round robin that is not of 4v4 alone; points of RANKING are fitted to gaps."""

RATINGS = pl.Schema(
    {
        "entrant": pl.String,
        "bradley_terry": pl.Float64,  # log-odds to score more in a unit, mean 0
        "bradley_terry_rank": pl.Int64,
        "plackett_luce": pl.Float64,  # log-strength of a car by finishing places, mean 0
        "plackett_luce_rank": pl.Int64,
    }
)

STRATEGIES = pl.Schema(
    {
        "policy": pl.String,  # label; empty in the row of a strategy with all policies
        "strategy": pl.String,  # label; empty in the row of a policy with all strategies
        "entrant": pl.String,  # that is both; null in rows of one
        "points": pl.Float64,  # mean of a unit's race
        "points_low": pl.Float64,  # 95 % interval over units
        "points_high": pl.Float64,
        "effect": pl.Float64,  # of one: its mean less that of all; of both: what is left beside both effects
        "effect_low": pl.Float64,
        "effect_high": pl.Float64,
        "units": pl.Int64,
    }
)
"""Policies crossed with strategies, a two-way layout; empty where they are not."""

TOURNAMENT_NOTES = pl.Schema({"note": pl.String})
"""Sentences on what does not fit: ratings against points, lack of fit, cycles."""

INCIDENTS = pl.Schema(
    {
        "entrant": pl.String,
        "test": pl.String,
        "happened": pl.String,  # the incident, in a sentence
        "runs": pl.Int64,
        "clean": pl.Int64,  # of the runs
        "needed": pl.Float64,  # share of the runs that must be clean
        "passed": pl.Boolean,
    }
)
"""One row an entrant of the n-athlon and incident of an earlier race."""

LAPS = pl.Schema(
    {
        "entrant": pl.String,
        "distance_m": pl.Float64,  # along the centre line from the line, as in COURSE
        "time_s": pl.Float64,  # since the line was crossed; in the last row the lap's
        "x_m": pl.Float64,  # centre of the car, world frame
        "y_m": pl.Float64,
        "speed_m_s": pl.Float64,
        "pedals": pl.Float64,  # throttle less brake
    }
)
"""A flying lap of each entrant that reaches the team races."""

COURSE = pl.Schema(
    {
        "distance_m": pl.Float64,  # along the centre line from the line, to the line again
        "section": pl.String,  # name; empty outside of all
        "left_x_m": pl.Float64,  # edges of the road, world frame
        "left_y_m": pl.Float64,
        "right_x_m": pl.Float64,
        "right_y_m": pl.Float64,
        "time_s": pl.Float64,  # of the built-in driver's line at the speeds that it aims at
        "x_m": pl.Float64,
        "y_m": pl.Float64,
        "speed_m_s": pl.Float64,
    }
)
"""The circuit that the laps were driven on."""

CURVES = pl.Schema(
    {
        "checkpoints": pl.String,  # what the paths of the run's checkpoints begin with
        "updates": pl.Int64,
        "transitions": pl.Int64,
        "lap_s": pl.Float64,  # null where not all laps were completed
        "off_course_share": pl.Float64,
        "mean_q": pl.Float64,  # null of what learnt without critics, as the next
        "entropy": pl.Float64,
    }
)
"""How the training runs went that the entrants come from."""

TABLES: dict[str, pl.Schema] = {
    "entrants": ENTRANTS,
    "pareto": PARETO,
    "objectives": OBJECTIVES,
    "skills": SKILLS,
    "battery": BATTERY,
    "incidents": INCIDENTS,
    "ranking": RANKING,
    "pool": RANKING,  # over the round robins of all nights
    "pool_cells": POOL_CELLS,
    "pool_totals": POOL_TOTALS,
    "matchups": MATCHUPS,
    "ratings": RATINGS,
    "strategies": STRATEGIES,
    "tournament_notes": TOURNAMENT_NOTES,
    "laps": LAPS,
    "course": COURSE,
    "curves": CURVES,
}
"""The stage tables by name; results are kept by match and stand apart."""


def came_out_alike(results: pl.DataFrame, stored: pl.DataFrame) -> bool:
    """Whether RESULTS of a match are, to the bit, those that a store gave back."""
    # A store knows neither NaN nor a negative zero, and gives rows in this order.
    results = results.with_columns(pl.col(pl.Float64).fill_nan(None) + 0.0).sort("race", "car")
    return results.equals(stored)
