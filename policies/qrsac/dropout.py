"""Which units of a network are dropped, as a function of a seed."""

from __future__ import annotations

import torch
from torch import Tensor


def dropout_factors(seed: Tensor, shape: tuple[int, int], dropout: float) -> Tensor:
    """Factors on units: 0 for a dropped one, 1 / (1 - dropout) for a kept one.

    They are hashes of the units' numbers (`lowbias32`; Wellons, "Prospecting for hash functions", 2018), so
    that a compiled graph makes them where it needs them: to draw as many random numbers takes a tenth of an
    update.

    Args:
        seed: (2,) int32, drawn at random, on the device of the factors.
        shape: of the factors, less than 2^31 in all.
        dropout: chance of each unit to be dropped.
    """
    units = torch.arange(shape[0] * shape[1], dtype=torch.int32, device=seed.device).view(shape)
    mixed = units ^ seed[0]
    # Shifts of signed numbers bring in copies of the sign, which are masked out.
    mixed = (mixed ^ ((mixed >> 16) & 0xFFFF)) * 0x7FEB352D + seed[1]
    mixed = (mixed ^ ((mixed >> 15) & 0x1FFFF)) * (0x846CA68B - 2**32)
    mixed = mixed ^ ((mixed >> 16) & 0xFFFF)
    bound = min(round(dropout * 2**32), 2**32 - 1) - 2**31
    return torch.where(mixed >= bound, 1.0 / (1.0 - dropout), 0.0)
