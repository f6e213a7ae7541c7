"""The kernels that workers need, loaded by the process that they are forked from: it takes seconds."""

from nathlon.policies.hosting.spawned import forget_safe_path
from nathlon.policies.kernels import load_kernels

forget_safe_path()
load_kernels()
