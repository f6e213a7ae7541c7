"""Makes the environments known to Gymnasium, without loading it for those who do not use it."""

from __future__ import annotations

import sys

TYPE_CHECKING = False  # every program that imports nathlon loads this module, and `typing` takes longer
if TYPE_CHECKING:
    from collections.abc import Sequence
    from importlib.machinery import ModuleSpec
    from types import ModuleType
    from typing import Any

GYMNASIUM = "gymnasium"
ENVIRONMENTS: dict[str, dict[str, Any]] = {
    "nathlon/TimeTrial-v0": {"scenario": "1v0", "opponents": ()},
    "nathlon/Race-v0": {},
}
"""Names, and the arguments in which they differ from `RaceGymEnv`."""


class _AfterGymnasium:
    """Registers the environments once Gymnasium has been loaded."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname != GYMNASIUM:
            return None
        from importlib.util import find_spec

        sys.meta_path.remove(self)
        spec = find_spec(GYMNASIUM)
        if spec is not None and spec.loader is not None:
            load = spec.loader.exec_module

            def load_and_register(module: ModuleType) -> None:
                load(module)
                register()

            spec.loader.exec_module = load_and_register  # type: ignore[method-assign]
        return spec


def register() -> None:
    """Make the environments known to Gymnasium, which this loads."""
    import gymnasium

    for name, arguments in ENVIRONMENTS.items():
        gymnasium.register(
            name,
            entry_point="nathlon.policies.environments.race_gym_env:RaceGymEnv",
            vector_entry_point="nathlon.policies.environments.race_vector_env:RaceVectorEnv",
            kwargs=arguments,
        )
    gymnasium.register(
        "nathlon/Strategy-v0", entry_point="nathlon.policies.environments.strategy_env:StrategyEnv"
    )


def register_with_gymnasium() -> None:
    """Register at once where Gymnasium has been loaded, or else as soon as it is."""
    if GYMNASIUM in sys.modules:
        register()
    else:
        sys.meta_path.insert(0, _AfterGymnasium())
