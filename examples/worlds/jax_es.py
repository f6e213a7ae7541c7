"""A policy in JAX: parameters in an `.npz`, and the function that they belong to.

pip install jax
python -m examples.worlds.jax_es runs/jax-1 --seed 1
nathlon evaluate runs/jax-1 --world examples/worlds/jax_es.py:world --out runs/jax-1-selected

Parameters of Flax go the same way: `load={".msgpack": load}`, with
`flax.serialization.msgpack_restore(path.read_bytes())` and `module.apply`.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import gymnasium
import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np

from nathlon import GymnasiumWorld

ROUNDS, PAIRS, WIDTH, RATE = 36, 8, 0.1, 0.1
Parameters = dict[str, Any]


def initial(key: Any, seen: int, choices: int) -> Parameters:
    """Parameters of two layers."""
    first, second = jax.random.split(key)
    return {
        "w1": jax.random.normal(first, (seen, 16)) / seen**0.5,
        "b1": jnp.zeros(16),
        "w2": jax.random.normal(second, (16, choices)) / 4.0,
        "b2": jnp.zeros(choices),
    }


@jax.jit
def scores(parameters: Parameters, observation: Any) -> Any:
    """Of each choice, for one observation."""
    hidden = jnp.tanh(observation @ parameters["w1"] + parameters["b1"])
    return hidden @ parameters["w2"] + parameters["b2"]


def load(path: Path, observation_space: Any, action_space: Any) -> Any:
    """The function of a file's parameters."""
    with np.load(path) as file:
        parameters = {name: jnp.asarray(file[name]) for name in file}
    return lambda observation: int(scores(parameters, observation).argmax())


def pole() -> Any:
    """A pole on a cart: a point for every step that it stays up."""
    return gymnasium.make("CartPole-v1")


world = GymnasiumWorld(
    {"pole": pole}, load={".npz": load}, packages=("gymnasium", "jax", "jaxlib"), most_steps=500
)


def length(environment: Any, parameters: Parameters, seed: int) -> float:
    """Steps of an episode."""
    observation, _ = environment.reset(seed=seed)
    steps, over = 0, False
    while not over:
        choice = int(scores(parameters, observation).argmax())
        observation, _, terminated, truncated, _ = environment.step(choice)
        steps, over = steps + 1, terminated or truncated
    return float(steps)


def train(out: Path, seed: int, rounds: int = ROUNDS) -> None:
    """Train by evolution strategies (Salimans et al., 2017), and save the parameters twelve times."""
    environment, key = pole(), jax.random.key(seed)
    parameters = initial(key, 4, 2)
    for number in range(1, rounds + 1):
        key, drawn = jax.random.split(key)
        flat, whole = jax.flatten_util.ravel_pytree(parameters)
        noise = jax.random.normal(drawn, (PAIRS, flat.size))
        gains = [
            length(environment, whole(flat + WIDTH * one), number)
            - length(environment, whole(flat - WIDTH * one), number)
            for one in noise
        ]
        shares = np.array(gains) / (np.std(gains) + 1e-6)
        parameters = whole(flat + RATE * jnp.asarray(shares) @ noise / PAIRS)
        if number % max(rounds // 12, 1) == 0:
            arrays: dict[str, Any] = {name: np.asarray(value) for name, value in parameters.items()}
            np.savez(out / f"es_{seed}_{number:04}.npz", **arrays)
            print(f"{number}: {length(environment, parameters, 0):.0f} steps", flush=True)


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description="Train a policy in JAX, and keep twelve of it")
    parser.add_argument("out", type=Path, help="folder for the parameters")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    train(given.out, given.seed)


if __name__ == "__main__":
    main()
