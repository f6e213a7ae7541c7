"""Put the limit lap times into the package, where reports compare laps with them.

Run as `python -m benchmarks.lap_limit.ship`, only right after the benchmark has left its results: the file
holds digests of circuits and cars as they are now, which must be those of the results.
"""

from __future__ import annotations

import json

from benchmarks.result import RESULTS, read_result
from nathlon.selection.publish.lap_limits import SHIPPED, place_digests
from nathlon.sim.whole_file import whole_file


def main() -> None:
    """Write `nathlon/data/lap_limits.json`."""
    result = read_result(RESULTS / "lap_limit.json")
    laps = [
        {name: lap[name] for name in ("circuit", "car", "limit_s")}
        | place_digests(lap["circuit"], lap["car"])._asdict()
        for lap in result.figures["laps"]
    ]
    source = f"minimum-time laps by optimal control, {result.date}: {result.command}"
    with whole_file(SHIPPED) as partial:
        partial.write_text(json.dumps({"source": source, "laps": laps}, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
