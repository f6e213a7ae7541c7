"""What workers need and takes seconds to load: imported by the process that they are forked from.

It starts no threads, and so can be forked; polars does, and is left to the workers.
"""

from nathlon.policies.kernels import load_kernels

load_kernels()
