"""Spaces of Gymnasium, or of the Gym before it, as pickles tell of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces

from nathlon.policies.sources.inert_pickle import Record, array_of, dtype_of

Space = spaces.Space[Any]
MOST_SPACES = 1000
"""Inside one another."""


def space_of(value: Any) -> Space:
    """The space that a record stands for.

    Raises:
        ValueError: if it is none that is known.
    """
    try:
        return _space(value, 0)
    # Gymnasium says in many ways that something is no space.
    except (AssertionError, TypeError, OverflowError, IndexError) as error:
        raise ValueError(f"has no space that is known ({error})") from None


def _space(value: Any, depth: int) -> Space:
    if not isinstance(value, Record) or "spaces." not in value.named or depth > 8:
        raise ValueError("has no space that is known")
    fields = value.fields
    match value.named.rpartition(" ")[2]:
        case "Box":
            low, high, dtype = array_of(fields.get("low")), array_of(fields.get("high")), fields.get("dtype")
            return spaces.Box(low, high, dtype=dtype_of(dtype).type)
        case "Discrete":
            start = array_of(fields.get("start", 0))  # not there before gym 0.19
            return spaces.Discrete(_whole(fields.get("n")), start=int(start))
        case "MultiDiscrete":
            nvec = array_of(fields.get("nvec"))
            first = array_of(fields["start"]) if "start" in fields else None
            return spaces.MultiDiscrete(nvec.astype(np.int64), start=first)
        case "MultiBinary":
            n = fields.get("n")
            return spaces.MultiBinary([_whole(size) for size in n] if isinstance(n, tuple) else _whole(n))
        case "Dict":
            inner = fields.get("spaces")
            if isinstance(inner, Mapping) and 0 < len(inner) <= MOST_SPACES:
                named = {str(key): _space(one, depth + 1) for key, one in inner.items()}
                found = spaces.Dict(named)
                found.spaces = named  # in the order of training
                return found
        case "Tuple":
            inner = fields.get("spaces")
            if isinstance(inner, tuple | list) and 0 < len(inner) <= MOST_SPACES:
                return spaces.Tuple([_space(one, depth + 1) for one in inner])
    raise ValueError(f"has {value.named.replace(' ', '.')}, which is no space that is known")


def _whole(value: Any) -> int:
    array = array_of(value)
    if array.size != 1 or array.dtype.kind not in "iu" or not 0 < int(array) < 1 << 40:
        raise ValueError("has a space of no size")
    return int(array)
