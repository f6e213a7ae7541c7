"""What decides how a race ends: the files whose change makes what was computed before worthless.

Keys of stored matches, the cache of compiled kernels and what the built-in driver learnt in practice all
hold for one state of these files.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

PACKAGE = Path(__file__).parent.parent
"""The folder of `nathlon`, in a checkout and in a wheel."""

DECISIVE = (
    "sim/physics",
    "sim/data",
    "sim/camera",
    "sim/blue_flags.py",
    "sim/camera_spec.py",
    "sim/car.py",
    "sim/car_facts.py",
    "sim/car_models.py",
    "sim/clock.py",
    "sim/conditions.py",
    "sim/track/centre_line.py",
    "sim/track/crossing.py",
    "sim/data_file.py",
    "sim/expressions",
    "sim/instruments",
    "sim/episode.py",
    "sim/kernel.py",
    "sim/simd.py",
    "sim/observation.py",
    "sim/observation_kernel.py",
    "sim/observation_parameters.py",
    "sim/parameters.py",
    "sim/plan.py",
    "sim/reaction.py",
    "sim/race_step.py",
    "sim/rules.py",
    "sim/scenario.py",
    "sim/scenario_start.py",
    "sim/service.py",
    "sim/state.py",
    "sim/steward.py",
    "sim/timing.py",
    "sim/track/__init__.py",
    "sim/track/pit_lane.py",
    "sim/tyre_curve.py",
    "sim/weather.py",
    "sim/work_stealing.py",
    "sim/world.py",
    "policies/sb3_racer.py",
    "policies/sources",
    "policies/checkpoint.py",
    "policies/convolutions.py",
    "policies/driver",
    "policies/general",
    "policies/isolation.py",
    "policies/load.py",
    "policies/memory_limit.py",
    "policies/mlp.py",
    "policies/patience.py",
    "policies/planning",
    "policies/policy.py",
    "policies/policy_file.py",
    "policies/stint_model.py",
    "policies/stint_planner.py",
    "policies/stint_search.py",
    "policies/strategy.py",
    "policies/strict_json.py",
    "policies/temper.py",
    "policies/vision.py",
    "policies/weights.py",
    "arena/classification.py",
    "arena/halt.py",
    "arena/match.py",
    "arena/match_policies.py",
    "arena/pit_walls.py",
    "arena/results.py",
    "arena/runner.py",
    "arena/stints.py",
    "arena/team.py",
    "arena/team_of_networks.py",
    "arena/watch.py",
)
"""Files, and folders with all that is in them, by their place in the package."""

SUFFIXES = (".py", ".toml", ".csv")
"""Of the files that count in a folder."""


EPISODES = (
    "arena/world.py",
    "arena/world_finding.py",
    "arena/worlds",
    "arena/classification.py",
    "arena/match.py",
    "arena/results.py",
    "arena/rounding.py",
    "policies/convolutions.py",
    "policies/general",
    "policies/hosting/wire.py",
    "policies/isolation.py",
    "policies/memory_limit.py",
    "policies/mlp.py",
    "policies/patience.py",
    "policies/policy_file.py",
    "policies/sources",
    "policies/strict_json.py",
    "policies/weights.py",
)
"""What decides, in the same way, how an episode of another world ends, beside that world's own files."""


def files(package: Path = PACKAGE, names: tuple[str, ...] = DECISIVE) -> Iterator[Path]:
    """The decisive files in the order of `names`, those of a folder by name.

    Raises:
        FileNotFoundError: if one that is listed does not exist.
    """
    for name in names:
        path = package / name
        if path.is_dir():
            yield from sorted(file for file in path.rglob("*") if file.suffix in SUFFIXES)
        elif path.is_file():
            yield path
        else:
            raise FileNotFoundError(path)


@lru_cache
def fingerprint(package: Path = PACKAGE, names: tuple[str, ...] = DECISIVE) -> str:
    """SHA-256 in hexadecimal of the places and contents of the decisive files.

    Args:
        package: a folder laid out as `nathlon`.
        names: files and folders in it, DECISIVE or EPISODES.

    Raises:
        FileNotFoundError: if a file that is listed does not exist.
    """
    digest = hashlib.sha256()
    for path in files(package, names):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(package).as_posix()}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()
