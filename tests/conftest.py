"""Settings of the whole suite."""

import os

# Two test processes share two cores: BLAS and torch must not take more than one each.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
