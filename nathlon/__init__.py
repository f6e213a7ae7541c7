"""Which of my thousands of racing checkpoints do I send to the race, and why?

    import nathlon

    result = nathlon.select("checkpoints/", out="runs/mine")  # filter, n-athlon, committee, round robin
    result.ranking                                            # a polars frame

What is here loads what it needs when it is first used. Importing the package makes `nathlon/Race-v0` and
`nathlon/TimeTrial-v0` known to Gymnasium.
"""

from __future__ import annotations

try:
    from nathlon.policies.registration import register_with_gymnasium
except ModuleNotFoundError as error:
    if error.name not in ("nathlon.policies", "nathlon.policies.registration"):
        raise
    raise ImportError(
        "nathlon/policies is no folder: this clone has no symbolic links; clone with "
        "`git clone -c core.symlinks=true`, on Windows in developer mode"
    ) from None

TYPE_CHECKING = False  # so named, type checkers take it for true; `typing` takes longer to load than all this
if TYPE_CHECKING:
    from typing import Any

    from nathlon.api.coach import CoachResult, coach
    from nathlon.api.events import (
        EnduranceResult,
        SeasonResult,
        WeekendResult,
        endurance,
        season,
        weekend,
    )
    from nathlon.api.gate import GateResult, gate
    from nathlon.api.league import LeagueResult, league
    from nathlon.api.matrix import MatrixResult, matrix
    from nathlon.api.plan import plan
    from nathlon.api.race import RaceResult, race
    from nathlon.api.recipes import RecipesResult, recipes
    from nathlon.api.reward import RewardDesign, design_reward
    from nathlon.api.selection import SelectionResult, select
    from nathlon.api.stints import StintsResult, stints
    from nathlon.api.train import TrainingResult, train
    from nathlon.api.twin import TwinResult, twin
    from nathlon.api.worker import work
    from nathlon.arena.worlds.environment import GymnasiumWorld, PettingZooWorld
    from nathlon.arena.worlds.formula import Formula
    from nathlon.arena.worlds.seat_record import Declared
    from nathlon.arena.worlds.vector import VectorWorld
    from nathlon.lab.siblings.run import TrainingRun
    from nathlon.lab.siblings.sb3 import NathlonCallback
    from nathlon.policies.environments.formula_reward import FormulaReward
    from nathlon.policies.environments.race_gym_env import RaceGymEnv
    from nathlon.policies.environments.race_vector_env import RaceVectorEnv
    from nathlon.policies.load import load_policy
    from nathlon.policies.policy import Policy
    from nathlon.results.forecast import Forecast
    from nathlon.selection.config import Config
    from nathlon.sim import parallel_env
    from nathlon.sim.errors import InputError
    from nathlon.sim.expressions import Quantity
    from nathlon.sim.observation import ObservationSpec

_NAMES = {
    "nathlon.api.coach": ("CoachResult", "coach"),
    "nathlon.api.events": (
        "EnduranceResult",
        "SeasonResult",
        "WeekendResult",
        "endurance",
        "season",
        "weekend",
    ),
    "nathlon.api.gate": ("GateResult", "gate"),
    "nathlon.api.league": ("LeagueResult", "league"),
    "nathlon.api.matrix": ("MatrixResult", "matrix"),
    "nathlon.api.plan": ("plan",),
    "nathlon.api.race": ("RaceResult", "race"),
    "nathlon.api.recipes": ("RecipesResult", "recipes"),
    "nathlon.api.reward": ("RewardDesign", "design_reward"),
    "nathlon.api.selection": ("SelectionResult", "select"),
    "nathlon.api.stints": ("StintsResult", "stints"),
    "nathlon.api.train": ("TrainingResult", "train"),
    "nathlon.api.twin": ("TwinResult", "twin"),
    "nathlon.api.worker": ("work",),
    "nathlon.arena.worlds.environment": ("GymnasiumWorld", "PettingZooWorld"),
    "nathlon.arena.worlds.formula": ("Formula",),
    "nathlon.arena.worlds.seat_record": ("Declared",),
    "nathlon.arena.worlds.vector": ("VectorWorld",),
    "nathlon.lab.siblings.run": ("TrainingRun",),
    "nathlon.lab.siblings.sb3": ("NathlonCallback",),
    "nathlon.policies.environments.formula_reward": ("FormulaReward",),
    "nathlon.policies.environments.race_gym_env": ("RaceGymEnv",),
    "nathlon.policies.environments.race_vector_env": ("RaceVectorEnv",),
    "nathlon.policies.load": ("load_policy",),
    "nathlon.policies.policy": ("Policy",),
    "nathlon.results.forecast": ("Forecast",),
    "nathlon.selection.config": ("Config",),
    "nathlon.sim": ("parallel_env",),
    "nathlon.sim.errors": ("InputError",),
    "nathlon.sim.expressions": ("Quantity",),
    "nathlon.sim.observation": ("ObservationSpec",),
}
_FROM = {name: module for module, names in _NAMES.items() for name in names}

__all__ = [
    "CoachResult",
    "Config",
    "Declared",
    "EnduranceResult",
    "Forecast",
    "Formula",
    "FormulaReward",
    "GateResult",
    "GymnasiumWorld",
    "InputError",
    "LeagueResult",
    "MatrixResult",
    "NathlonCallback",
    "ObservationSpec",
    "PettingZooWorld",
    "Policy",
    "Quantity",
    "RaceGymEnv",
    "RaceResult",
    "RaceVectorEnv",
    "RecipesResult",
    "RewardDesign",
    "SeasonResult",
    "SelectionResult",
    "StintsResult",
    "TrainingResult",
    "TrainingRun",
    "TwinResult",
    "VectorWorld",
    "WeekendResult",
    "coach",
    "design_reward",
    "endurance",
    "gate",
    "league",
    "load_policy",
    "matrix",
    "parallel_env",
    "plan",
    "race",
    "recipes",
    "season",
    "select",
    "stints",
    "train",
    "twin",
    "weekend",
    "work",
]


def __getattr__(name: str) -> Any:
    if name not in _FROM:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_FROM[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


register_with_gymnasium()
