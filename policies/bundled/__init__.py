"""The checkpoints that come with nathlon; README.md tells how they were made."""

import tomllib
from pathlib import Path

from nathlon.sim.errors import InputError

BUNDLED = Path(__file__).parent


def champions() -> list[Path]:
    """The best checkpoint of each circuit."""
    names = tomllib.loads((BUNDLED / "champions.toml").read_text("utf-8"))["names"]
    return [BUNDLED / f"{name}.safetensors" for name in names]


def champion(circuit: str, car: str) -> Path:
    """The best checkpoint of a circuit, for a car.

    Raises:
        InputError: if there is none.
    """
    from nathlon.policies.checkpoint import read_card

    for path in champions():
        card = read_card(path)
        if (card.circuit, card.car) == (circuit, car):
            return path
    raise InputError(f"champion: none comes with nathlon for {circuit} and {car}, expected the path of one")


def generalist() -> Path:
    """The checkpoint for any car on any circuit that has learnt longest."""
    from nathlon.policies.checkpoint import read_card  # whoever only names the folder need not wait for it

    return max((BUNDLED / "generalist").glob("*.safetensors"), key=lambda path: read_card(path).step or 0)
