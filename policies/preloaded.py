"""What workers need and takes seconds to load: imported by the process that they are forked from.

It starts no threads, and so can be forked; polars does, and is left to the workers.
"""

from nathlon.policies.hosting.spawned import forget_safe_path
from nathlon.policies.kernels import load_kernels

forget_safe_path()
load_kernels()
