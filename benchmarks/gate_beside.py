"""Gates of other packages, for `benchmarks.gate_table`; runs in an interpreter that has them and not ours.

`python gate_beside.py NAME FILE MARGIN RATE`: FILE holds laps of candidate and champion, gate by gate, null
where one broke down. MARGIN is a share of the champion's lap, RATE that of breakdowns that matter. Prints the
package's version and its verdicts as JSON.

- `physim-gate`: mean lap and failure rate, paired by trial, one-sided 95 %, otherwise as by default;
- `robostats` compares success alone: a pass where the lower bound of the difference in completed runs,
  one-sided 95 %, lies above -RATE, a fail where the upper one lies below 0.
"""

from __future__ import annotations

import importlib
import json
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

Laps = list[float | None]


def physim_gate(candidate: Laps, champion: Laps, margin: float, rate: float) -> str:
    """The verdict of physim-gate."""
    schema, config, engine = (
        importlib.import_module(f"physim_gate.{module}") for module in ("schema", "config", "engine")
    )

    def run(name: str, laps: Laps) -> Any:
        trials = [
            {
                "trial_id": f"start-{number}",
                "seed": number,
                "status": "ok" if lap is not None else "failed",
                "failure": None if lap is not None else {"kind": "stuck"},
                "metrics": {"lap": lap},
            }
            for number, lap in enumerate(laps)
        ]
        return schema.run_from_data(
            {
                "run_id": name,
                "simulator": {"name": "laps", "version": "1"},
                "scenario": {"id": "time trial", "version": "1"},
                "metrics": {"lap": {"direction": "lower_is_better", "unit": "s"}},
                "trials": trials,
            }
        )

    gate = config.config_from_data(
        {
            "version": 1,
            "defaults": {"bootstrap_resamples": 1000, "confidence": 0.9},
            "metrics": {
                "lap": {"max_relative_degradation": margin},
                "physim.failure_rate": {"max_absolute_degradation": rate},
            },
        }
    )
    told = engine.compare_runs(run("champion", champion), run("candidate", candidate), gate)
    return str(told.verdict.value).lower()


def robostats(candidate: Laps, champion: Laps, margin: float, rate: float) -> str:
    """The verdict of robostats' interval on completed runs."""
    package = importlib.import_module("robostats")
    both = [(ours is not None, theirs is not None) for ours, theirs in zip(candidate, champion, strict=True)]
    table = package.PairedResult(
        policy_id_a="candidate",
        policy_id_b="champion",
        n_both_success=both.count((True, True)),
        n_a_success_b_failure=both.count((True, False)),
        n_b_success_a_failure=both.count((False, True)),
        n_both_failure=both.count((False, False)),
        scenario_ids=tuple(f"{number:03}" for number in range(len(both))),
        dropped_from_a=0,
        dropped_from_b=0,
        protocol_fingerprints_a=(),
        protocol_fingerprints_b=(),
        replicates=None,
    )
    bounds = package.paired_difference(table, confidence=0.9)
    return "pass" if bounds.lower > -rate else "fail" if bounds.upper < 0 else "cannot tell"


GATES = {"physim-gate": physim_gate, "robostats": robostats}


def main() -> None:
    """Judge all, and print."""
    name, path, margin, rate = sys.argv[1:]
    drawn = json.loads(Path(path).read_text("utf-8"))
    said = [GATES[name](ours, theirs, float(margin), float(rate)) for ours, theirs in drawn]
    print(json.dumps({"version": version(name), "said": said}))


if __name__ == "__main__":
    main()
