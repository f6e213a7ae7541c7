"""What kind of processor computes here: on another kind, results can differ in the last digits."""

from __future__ import annotations

import hashlib
import os
from functools import cache

import llvmlite.binding as llvm
import numpy as np

ROWS, INPUTS, OUTPUTS = 8, 61, 64
"""Of a product too small for more than one thread, whose number must not matter."""


@cache
def processor() -> str:
    """This machine's kind, such as `znver4-1f3a`.

    It is the name by which kernels are compiled, and four digits of a hash of the instructions that they may
    use and of what numpy's products and functions come to here, whose code is chosen by the machine too.
    `NUMBA_CPU_NAME`, `NUMBA_CPU_FEATURES`, `OPENBLAS_CORETYPE` and `NPY_DISABLE_CPU_FEATURES` pin it.
    """
    values = np.sin(np.arange(ROWS * INPUTS) * 0.7).astype(np.float32).reshape(ROWS, INPUTS)
    weights = np.cos(np.arange(INPUTS * OUTPUTS) * 0.3).astype(np.float32).reshape(INPUTS, OUTPUTS)
    sums = values @ weights
    computed = (sums, np.tanh(sums), np.exp(values), np.arctan2(values, 0.3), np.abs(values) ** 1.7)
    features = os.environ.get("NUMBA_CPU_FEATURES") or llvm.get_host_cpu_features().flatten()
    hashed = hashlib.sha256(features.encode())
    for array in computed:
        hashed.update(array.tobytes())
    name = os.environ.get("NUMBA_CPU_NAME") or llvm.get_host_cpu_name()
    return f"{name}-{hashed.hexdigest()[:4]}"
