"""Makes the files of older versions of Stable-Baselines3 in `tests/data/sb3`, with what `predict` gave there.

It runs in an environment that has such a version: `python tests/policies/old_stable_baselines.py FOLDER`.
"""

# mypy: ignore-errors

import sys
from pathlib import Path

import numpy as np

try:
    import gymnasium
except ImportError:  # before 2.0
    import gym as gymnasium
from sb3_contrib import TQC, RecurrentPPO
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

spaces = gymnasium.spaces
NUMBERS = spaces.Box(-np.inf, np.inf, (3,), np.float64)
PAIR = spaces.Dict({"b": spaces.Box(-1.0, 1.0, (2,), np.float32), "a": spaces.Discrete(3)})
ACTIONS = spaces.Box(np.array([-2.0, 0.1], np.float32), np.array([2.0, 0.4], np.float32))
SHOWN = 1000
SMALL = {"net_arch": [6]}


def environment(seen, done):
    """One without a world."""

    class Still(gymnasium.Env):
        observation_space, action_space = seen, done

    return DummyVecEnv([Still])


def shown():
    """Observations of NUMBERS; of PAIR they are made of these."""
    return np.random.default_rng(0).normal(3.0, 5.0, (SHOWN, 3))


def main(folder):
    """Write the files."""
    folder.mkdir(parents=True, exist_ok=True)
    on = {"n_steps": 8, "batch_size": 8, "device": "cpu", "seed": 1}
    rows = shown()

    normalised = VecNormalize(environment(NUMBERS, ACTIONS), clip_obs=1.5)
    normalised.obs_rms.update(rows[:100] * [1.0, 2.0, 0.5])
    model = PPO("MlpPolicy", normalised, policy_kwargs=dict(SMALL), **on)
    model.policy.action_net.weight.data *= 100.0
    model.save(folder / "ppo_8_steps.zip")
    normalised.save(str(folder / "ppo_vecnormalize_8_steps.pkl"))
    np.save(folder / "ppo.npy", model.predict(normalised.normalize_obs(rows), deterministic=True)[0])

    model = PPO("MultiInputPolicy", environment(PAIR, spaces.Discrete(4)), policy_kwargs=dict(SMALL), **on)
    model.policy.action_net.weight.data *= 100.0
    model.save(folder / "pair.zip")
    pairs = {"b": np.tanh(rows[:, :2]).astype(np.float32), "a": np.abs(rows[:, 2]).astype(int) % 3}
    np.save(folder / "pair.npy", model.predict(pairs, deterministic=True)[0].astype(np.int8))

    model = TQC(
        "MlpPolicy",
        environment(NUMBERS, ACTIONS),
        use_sde=True,
        buffer_size=10,
        seed=1,
        device="cpu",
        policy_kwargs={"net_arch": {"pi": [6], "qf": [2]}, "n_critics": 1, "n_quantiles": 2},
    )
    model.save(folder / "tqc.zip")
    np.save(folder / "tqc.npy", model.predict(rows, deterministic=True)[0])

    kept = {"lstm_hidden_size": 4, "enable_critic_lstm": False, **SMALL}
    model = RecurrentPPO("MlpLstmPolicy", environment(NUMBERS, spaces.Discrete(4)), policy_kwargs=kept, **on)
    model.policy.action_net.weight.data *= 100.0
    model.save(folder / "lstm.zip")
    state, found = None, []
    for row in rows:
        action, state = model.predict(row[None], state, np.zeros(1), deterministic=True)
        found.append(action[0])
    np.save(folder / "lstm.npy", np.array(found, np.int8))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
