"""Tianshou: the `state_dict` of a policy, read by the function that builds it.

pip install tianshou
python -m examples.worlds.tianshou_dqn runs/tianshou-1 --seed 1
nathlon evaluate runs/tianshou-1 --world examples/worlds/tianshou_dqn.py:world --out runs/tianshou-1-selected
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import gymnasium
import torch

from nathlon import GymnasiumWorld

EPOCHS, STEPS, SEATS = 12, 2000, 16


def policy_of(observation_space: Any, action_space: Any) -> Any:
    """The policy of the training script: the best of the values, and now and then another choice to learn."""
    from tianshou.algorithm.modelfree.dqn import DiscreteQLearningPolicy
    from tianshou.utils.net.common import Net

    model = Net(state_shape=observation_space.shape, action_shape=int(action_space.n), hidden_sizes=(64, 64))
    return DiscreteQLearningPolicy(
        model=model, action_space=action_space, observation_space=observation_space, eps_training=0.1
    )


def load(path: Path, observation_space: Any, action_space: Any) -> Any:
    """Its choice for one observation, with the weights of a file."""
    policy = policy_of(observation_space, action_space)
    policy.load_state_dict(torch.load(path, weights_only=True))
    policy.eval()
    return policy.compute_action


def pole() -> Any:
    """A pole on a cart: a point for every step that it stays up."""
    return gymnasium.make("CartPole-v1")


world = GymnasiumWorld({"pole": pole}, load=load, packages=("gymnasium", "tianshou", "torch"), most_steps=500)


def train(out: Path, seed: int, epochs: int = EPOCHS) -> None:
    """Train with DQN, and save the policy after every epoch."""
    from tianshou.algorithm.modelfree.dqn import DQN
    from tianshou.algorithm.optim import AdamOptimizerFactory
    from tianshou.data import Collector, VectorReplayBuffer
    from tianshou.env import DummyVectorEnv
    from tianshou.trainer import OffPolicyTrainerParams

    environment = pole()
    torch.manual_seed(seed)
    policy = policy_of(environment.observation_space, environment.action_space)
    algorithm: Any = DQN(
        policy=policy, optim=AdamOptimizerFactory(lr=1e-3), n_step_return_horizon=3, target_update_freq=320
    )
    environments = DummyVectorEnv([pole] * SEATS)
    environments.seed(seed)
    buffer = VectorReplayBuffer(20_000, SEATS)
    collector: Any = Collector(algorithm, environments, buffer, exploration_noise=True)
    collector.reset()
    collector.collect(n_step=512)

    trainer = algorithm.create_trainer(
        OffPolicyTrainerParams(
            training_collector=collector,
            epoch_num_steps=STEPS,
            collection_step_num_env_steps=SEATS,
            update_step_num_gradient_steps_per_sample=1 / SEATS,
            show_progress=False,
        )
    )
    trainer.reset()
    for epoch in range(1, epochs + 1):
        trainer.execute_epoch()
        torch.save(policy.state_dict(), out / f"dqn_{seed}_{epoch:03}.pth")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description="Train with Tianshou's DQN, and keep a policy of each epoch")
    parser.add_argument("out", type=Path, help="folder for the policies")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    torch.set_num_threads(1)
    given.out.mkdir(parents=True, exist_ok=True)
    train(given.out, given.seed)


if __name__ == "__main__":
    main()
