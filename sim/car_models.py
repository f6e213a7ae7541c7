"""Cars of several models in one world: kernels read the parameters of each from a table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np
from numba import types
from numba.extending import overload

from nathlon.sim.car import MOST_GEARS, CarParameters


def model_table(models: Sequence[CarParameters]) -> CarParameters:
    """The kernels' view of the models of a world.

    Args:
        models: one or more.

    Returns:
        of a single one its parameters themselves, so that the kernels compile as if there could be no other;
        of several a table (models,) of records with the same fields, which stands for them in kernels.
    """
    if len(models) == 1:
        return models[0]
    rows = [model._replace(ratios=_padded(model)) for model in models]
    columns = [(name, np.asarray(value).dtype, np.shape(value)) for name, value in rows[0]._asdict().items()]
    table = np.array([tuple(row) for row in rows], np.dtype(columns, align=True))
    return cast(CarParameters, table)


def _padded(model: CarParameters) -> Any:
    """Gear ratios in as many numbers as a car can have."""
    return np.pad(model.ratios, (0, MOST_GEARS - model.gears))


def parameters_of(models: Any, model: int) -> CarParameters:
    """The parameters of one of the models of a table as of `model_table`."""
    return models if isinstance(models, CarParameters) else models[model]


@overload(parameters_of, inline="always", strict=False)
def _parameters_of(models: Any, model: Any) -> Callable[[Any, int], Any]:
    """As kernels do it: chosen by type when they are compiled, so that a single model costs nothing."""
    if isinstance(models, types.BaseTuple):
        return lambda models, model: models
    return lambda models, model: models[model]
