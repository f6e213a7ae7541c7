"""A recurrent policy of plain PyTorch: CartPole without its speeds, which the network must remember.

python -m examples.worlds.recurrent runs/recurrent-1 --seed 1
nathlon evaluate runs/recurrent-1 --world examples/worlds/recurrent.py:world --out runs/recurrent-1-selected
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import gymnasium
import torch
from gymnasium.spaces import Box
from torch import Tensor, nn

from nathlon import GymnasiumWorld

EPISODES, BATCH, UNITS, RATE = 1600, 16, 32, 1e-2


class Agent(nn.Module):
    """A gated recurrent unit, and scores of the choices."""

    def __init__(self, seen: int, choices: int) -> None:
        super().__init__()
        self.cell = nn.GRUCell(seen, UNITS)
        self.head = nn.Linear(UNITS, choices)

    def scores(self, observation: Any, memory: Tensor | None) -> tuple[Tensor, Tensor]:
        """Scores (choices,) for one observation, and the memory after it."""
        after: Tensor = self.cell(torch.as_tensor(observation, dtype=torch.float32), memory)
        return self.head(after), after

    def act(self, observation: Any, memory: Tensor | None) -> tuple[Tensor, Tensor]:
        """What nathlon asks for: the best choice, and the memory for the next step."""
        with torch.no_grad():
            scores, after = self.scores(observation, memory)
        return scores.argmax(), after


def load(path: Path, observation_space: Any, action_space: Any) -> Agent:
    """The agent of a file."""
    agent = Agent(observation_space.shape[0], action_space.n)
    agent.load_state_dict(torch.load(path, weights_only=True))
    return agent


def pole() -> Any:
    """A pole on a cart, of which places and angles are seen, but no speeds."""
    environment = gymnasium.make("CartPole-v1")
    bounds: Any = environment.observation_space
    seen = Box(bounds.low[::2], bounds.high[::2])
    return gymnasium.wrappers.TransformObservation(environment, lambda observation: observation[::2], seen)


world = GymnasiumWorld({"pole": pole}, load=load, packages=("gymnasium", "torch"), most_steps=500)


def train(out: Path, seed: int, episodes: int = EPISODES) -> None:
    """Train by REINFORCE, and save the agent twelve times."""
    torch.manual_seed(seed)
    environment = pole()
    agent = Agent(2, 2)
    optimizer = torch.optim.Adam(agent.parameters(), RATE)
    for batch in range(1, max(episodes // BATCH, 1) + 1):
        told, lengths = [], []
        for one in range(BATCH):
            observation, _ = environment.reset(seed=seed * 1_000_000 + batch * BATCH + one)
            memory, log_probs, over = None, [], False
            while not over:
                scores, memory = agent.scores(observation, memory)
                choice = torch.distributions.Categorical(logits=scores)
                drawn = choice.sample()  # type: ignore[no-untyped-call]
                log_probs.append(choice.log_prob(drawn))  # type: ignore[no-untyped-call]
                observation, _, terminated, truncated, _ = environment.step(int(drawn))
                over = terminated or truncated
            told.append(torch.stack(log_probs))
            lengths.append(len(log_probs))
        # What is still to come of an episode, against the mean of the batch at the same step.
        left = torch.nn.utils.rnn.pad_sequence([torch.arange(n, 0, -1.0) for n in lengths])
        gains = left - left.mean(1, keepdim=True)
        loss = -(gains / (gains.std() + 1e-6) * torch.nn.utils.rnn.pad_sequence(told)).sum() / sum(lengths)
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        if batch % max(episodes // BATCH // 12, 1) == 0:
            torch.save(agent.state_dict(), out / f"reinforce_{seed}_{batch * BATCH:06}.pt")
            print(f"{batch * BATCH}: {sum(lengths) / BATCH:.0f} steps an episode", flush=True)


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description="Train a recurrent policy, and keep twelve of it")
    parser.add_argument("out", type=Path, help="folder for the agents")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    torch.set_num_threads(1)
    given.out.mkdir(parents=True, exist_ok=True)
    train(given.out, given.seed)


if __name__ == "__main__":
    main()
