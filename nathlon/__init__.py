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
    from nathlon.arena.worlds.environment import Declared, GymnasiumWorld, PettingZooWorld
    from nathlon.arena.worlds.formula import Formula
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

_FROM = {
    "CoachResult": "nathlon.api.coach",
    "Config": "nathlon.selection.config",
    "Forecast": "nathlon.results.forecast",
    "Formula": "nathlon.arena.worlds.formula",
    "FormulaReward": "nathlon.policies.environments.formula_reward",
    "GateResult": "nathlon.api.gate",
    "InputError": "nathlon.sim.errors",
    "LeagueResult": "nathlon.api.league",
    "MatrixResult": "nathlon.api.matrix",
    "NathlonCallback": "nathlon.lab.siblings.sb3",
    "ObservationSpec": "nathlon.sim.observation",
    "Policy": "nathlon.policies.policy",
    "Quantity": "nathlon.sim.expressions",
    "RaceGymEnv": "nathlon.policies.environments.race_gym_env",
    "RaceResult": "nathlon.api.race",
    "RaceVectorEnv": "nathlon.policies.environments.race_vector_env",
    "RecipesResult": "nathlon.api.recipes",
    "RewardDesign": "nathlon.api.reward",
    "SelectionResult": "nathlon.api.selection",
    "StintsResult": "nathlon.api.stints",
    "TrainingResult": "nathlon.api.train",
    "TrainingRun": "nathlon.lab.siblings.run",
    "TwinResult": "nathlon.api.twin",
    "VectorWorld": "nathlon.arena.worlds.vector",
    "load_policy": "nathlon.policies.load",
    "GymnasiumWorld": "nathlon.arena.worlds.environment",
    "Declared": "nathlon.arena.worlds.environment",
    "PettingZooWorld": "nathlon.arena.worlds.environment",
    "coach": "nathlon.api.coach",
    "design_reward": "nathlon.api.reward",
    "gate": "nathlon.api.gate",
    "league": "nathlon.api.league",
    "matrix": "nathlon.api.matrix",
    "parallel_env": "nathlon.sim",
    "plan": "nathlon.api.plan",
    "race": "nathlon.api.race",
    "recipes": "nathlon.api.recipes",
    "select": "nathlon.api.selection",
    "stints": "nathlon.api.stints",
    "train": "nathlon.api.train",
    "twin": "nathlon.api.twin",
    "work": "nathlon.api.worker",
}

__all__ = [
    "CoachResult",
    "Config",
    "Declared",
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
    "SelectionResult",
    "StintsResult",
    "TrainingResult",
    "TrainingRun",
    "TwinResult",
    "VectorWorld",
    "coach",
    "design_reward",
    "gate",
    "league",
    "load_policy",
    "matrix",
    "parallel_env",
    "plan",
    "race",
    "recipes",
    "select",
    "stints",
    "train",
    "twin",
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
