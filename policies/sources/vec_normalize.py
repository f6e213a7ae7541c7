"""Statistics of `VecNormalize` of Stable-Baselines3: what `VecNormalize.save` writes, read as data."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nathlon.policies.policy import Batch
from nathlon.policies.policy_file import opening
from nathlon.policies.sources.inert_pickle import Record, array_of, read_pickle
from nathlon.sim.errors import InputError

EXPECTED = "expected what VecNormalize.save writes"


@dataclass(frozen=True)
class Normal:
    """How one array of an observation is normalised, as `VecNormalize.normalize_obs` does it.

    Attributes:
        mean, deviation: float64, of the array's shape.
        bound: within which its numbers are kept.
    """

    mean: NDArray[np.float64]
    deviation: NDArray[np.float64]
    bound: float

    def __call__(self, seen: NDArray[Any]) -> Batch:
        """float32 for numbers (n, *shape) of any type, computed in float64 and rounded once."""
        return np.clip((seen - self.mean) / self.deviation, -self.bound, self.bound).astype(np.float32)


@dataclass(frozen=True)
class Statistics:
    """Of the observations of a training.

    Attributes:
        path: of the file, for errors.
        by_key: how arrays are normalised by their key in a Dict, the only one by ''; none where only
            rewards were.
    """

    path: Path
    by_key: dict[str, Normal]

    @classmethod
    def read(cls, path: Path, content: bytes) -> Statistics:
        """The statistics in a file with these bytes.

        Raises:
            InputError: if it holds none.
        """
        with opening(path):
            try:
                return cls(path, _by_key(read_pickle(content)))
            except ValueError as error:
                raise InputError(f"{path}: {error}, {EXPECTED}") from None


def _by_key(read: Any) -> dict[str, Normal]:
    if not isinstance(read, Record) or not read.named.endswith(" VecNormalize"):
        raise ValueError("no VecNormalize")
    fields = read.fields
    if fields.get("norm_obs", True) is False:
        return {}
    epsilon, bound = (_number(fields, name) for name in ("epsilon", "clip_obs"))
    kept = fields.get("obs_rms")
    keys = fields.get("norm_obs_keys")
    if isinstance(kept, dict):
        named = list(kept) if keys is None else keys
        if not isinstance(named, list) or not all(isinstance(key, str) and key in kept for key in named):
            raise ValueError("norm_obs_keys are not those of obs_rms")
        return {key: _normal(kept[key], epsilon, bound) for key in named}
    return {"": _normal(kept, epsilon, bound)}


def _normal(kept: Any, epsilon: float, bound: float) -> Normal:
    if not isinstance(kept, Record) or not kept.named.endswith(" RunningMeanStd"):
        raise ValueError("obs_rms has no mean and variance")
    mean, variance = (array_of(kept.fields.get(name)).astype(np.float64) for name in ("mean", "var"))
    if mean.shape != variance.shape or not np.isfinite(mean).all():
        raise ValueError("mean of obs_rms is not finite, or of another shape than its variance")
    if not (np.isfinite(variance).all() and (variance + epsilon > 0).all()):
        raise ValueError("variance of obs_rms is not positive and finite")
    return Normal(mean, np.sqrt(variance + epsilon), bound)


def _number(fields: dict[str, Any], name: str) -> float:
    array = array_of(fields.get(name))
    if array.size != 1 or not (np.isfinite(array).all() and array.item() > 0):
        raise ValueError(f"{name} is no positive number")
    return float(array.item())
