"""CleanRL's `ppo_continuous_action`: bare `state_dict`s, which the script's own class reads.

python -m examples.worlds.cleanrl runs/pendulum-1 --seed 1
nathlon evaluate runs/pendulum-1 --world examples/worlds/cleanrl.py:world --out runs/pendulum-1-selected
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import Box
from torch import Tensor, nn
from torch.distributions import Normal

from nathlon import GymnasiumWorld

STEPS, ROLLOUT, EPOCHS, MINIBATCH = 40_960, 2048, 10, 64
GAMMA, LAMBDA, CLIP, RATE = 0.99, 0.95, 0.2, 3e-4


def layer(inputs: int, outputs: int, gain: float = 2**0.5) -> nn.Linear:
    """Weights orthogonal, biases 0."""
    made = nn.Linear(inputs, outputs)
    nn.init.orthogonal_(made.weight, gain)
    nn.init.zeros_(made.bias)
    return made


class Agent(nn.Module):
    """Critic and actor, as the script defines them."""

    def __init__(self, observation_space: Box, action_space: Box) -> None:
        super().__init__()
        seen, done = int(np.prod(observation_space.shape)), int(np.prod(action_space.shape))
        self.critic = nn.Sequential(layer(seen, 64), nn.Tanh(), layer(64, 64), nn.Tanh(), layer(64, 1, 1.0))
        self.actor_mean = nn.Sequential(
            layer(seen, 64), nn.Tanh(), layer(64, 64), nn.Tanh(), layer(64, done, 0.01)
        )
        self.actor_logstd = nn.Parameter(torch.zeros(1, done))

    def noise(self, observations: Tensor) -> Normal:
        """What actions are drawn from."""
        mean = self.actor_mean(observations)
        return Normal(mean, self.actor_logstd.expand_as(mean).exp())


def load(path: Path, observation_space: Any, action_space: Any) -> nn.Module:
    """The ten lines that nathlon asks for: the mean action of a file's agent."""
    agent = Agent(observation_space, action_space)
    agent.load_state_dict(torch.load(path, weights_only=True))
    return agent.actor_mean


def pendulum() -> Any:
    """A pole on a cart: a point for every step that it stays up, 1,000 at most."""
    return gymnasium.make("InvertedPendulum-v5")


world = GymnasiumWorld(
    {"pendulum": pendulum}, load=load, packages=("gymnasium", "mujoco", "torch"), most_steps=1000
)


def train(out: Path, seed: int) -> None:
    """Train with PPO, and save the agent after every rollout."""
    torch.manual_seed(seed)
    environment = gymnasium.wrappers.ClipAction(pendulum())
    agent = Agent(environment.observation_space, environment.action_space)  # type: ignore[arg-type]
    optimizer = torch.optim.Adam(agent.parameters(), RATE, eps=1e-5)
    observation, _ = environment.reset(seed=seed)
    for step in range(ROLLOUT, STEPS + 1, ROLLOUT):
        seen, done, log_prob, rewards, ends = [], [], [], [], []
        for _ in range(ROLLOUT):
            seen.append(torch.as_tensor(observation, dtype=torch.float32))
            with torch.no_grad():
                noise = agent.noise(seen[-1][None])
                done.append(noise.sample())  # type: ignore[no-untyped-call]
                log_prob.append(noise.log_prob(done[-1]).sum())  # type: ignore[no-untyped-call]
            observation, reward, terminated, truncated, _ = environment.step(done[-1][0].numpy())
            rewards.append(float(reward))
            ends.append(float(terminated or truncated))
            if ends[-1]:
                observation, _ = environment.reset()
        with torch.no_grad():
            latest = torch.as_tensor(observation, dtype=torch.float32)[None]
            values = agent.critic(torch.cat([torch.stack(seen), latest])).squeeze(1)
        update(
            agent, optimizer, torch.stack(seen), torch.cat(done), torch.stack(log_prob), values, rewards, ends
        )
        torch.save(agent.state_dict(), out / f"ppo_{seed}_{step:06}.cleanrl_model")
        print(f"{step}: {ROLLOUT / max(sum(ends), 1):.0f} steps an episode", flush=True)


def update(
    agent: Agent,
    optimizer: torch.optim.Optimizer,
    seen: Tensor,
    done: Tensor,
    log_prob: Tensor,
    values: Tensor,
    rewards: list[float],
    ends: list[float],
) -> None:
    """Epochs of PPO on a rollout; `values` has one more, of the observation after it."""
    gain, gains = torch.zeros(()), torch.zeros(len(rewards))
    for t in reversed(range(len(rewards))):
        left = 1.0 - ends[t]
        gain = rewards[t] + GAMMA * left * values[t + 1] - values[t] + GAMMA * LAMBDA * left * gain
        gains[t] = gain
    returns = gains + values[:-1]
    for _ in range(EPOCHS):
        for batch in torch.split(torch.randperm(len(rewards)), MINIBATCH):
            now = agent.noise(seen[batch]).log_prob(done[batch]).sum(1)  # type: ignore[no-untyped-call]
            ratio = (now - log_prob[batch]).exp()
            share = (gains[batch] - gains[batch].mean()) / (gains[batch].std() + 1e-8)
            policy = -torch.min(share * ratio, share * ratio.clamp(1 - CLIP, 1 + CLIP)).mean()
            value = 0.5 * (agent.critic(seen[batch]).squeeze(1) - returns[batch]).square().mean()
            optimizer.zero_grad()
            (policy + 0.5 * value).backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimizer.step()


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description="Train as CleanRL does, and keep all agents")
    parser.add_argument("out", type=Path, help="folder for the agents")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    torch.set_num_threads(1)
    given.out.mkdir(parents=True, exist_ok=True)
    train(given.out, given.seed)


if __name__ == "__main__":
    main()
