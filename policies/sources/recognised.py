"""Files that other libraries write, and that only the code which trained them can read, by their names."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

from nathlon.policies.policy_file import open_policy_file
from nathlon.policies.sources import ARCHIVE

_GIVES = "which gets path, observation space and action space, and gives what is called with an observation"
LOADER = f"expected a loader in the world's mapping: load=function, {_GIVES}"
"""What helps in other worlds."""
EXPORT = (
    f"expected --loader PATH.py:FUNCTION, {_GIVES}; or .safetensors, a .zip of Stable-Baselines3, or an ONNX "
    "graph"
)
"""What helps in our own."""
EITHER = (
    f"expected a loader, {_GIVES}: --loader PATH.py:FUNCTION, or load=function in another world's mapping"
)
"""What helps where the world is not known."""
_HEAD = 8
_NAMES = {
    ".cleanrl_model": "a CleanRL model",
    ".ckpt": "a checkpoint of Lightning or TensorFlow",
    ".msgpack": "a msgpack of parameters, as of Flax",
    ".joblib": "a joblib",
    ".h5": "an HDF5, as of Keras",
    ".hdf5": "an HDF5, as of Keras",
}
"""By suffix, of what its bytes do not tell."""
_RLLIB = ("rllib_checkpoint.json", "class_and_ctor_args.pkl", "rl_module", "learner_group")
"""Names in the folder of a checkpoint of RLlib."""


def recognised(path: Path) -> str:
    """What a file or folder is, as a noun with its article; '' for what may be a checkpoint, or is not known.

    Raises:
        InputError: if it cannot be read.
    """
    if any(os.path.exists(path / name) for name in _RLLIB):
        return "an RLlib checkpoint"
    with open_policy_file(path) as (file, _):
        head = file.read(_HEAD)
    suffix = path.suffix.lower()
    told = _NAMES.get(suffix, "")
    if head.startswith(ARCHIVE):
        return f"{told} (torch.save)" if told and _packed(path).startswith("a torch") else _packed(path)
    if head.startswith(b"\x93NUMPY"):
        return "a numpy array"
    if head[:1] == b"\x80" and head[1:2] <= b"\x05":
        return told or ("an old torch.save" if suffix in (".pt", ".pth") else "a pickle")
    return told


def _packed(path: Path) -> str:
    """Likewise of a zip archive."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except (OSError, ValueError, zipfile.BadZipFile, NotImplementedError):
        return "a broken zip archive"
    ends = {name.partition("/")[2] for name in names}
    if "constants.pkl" in ends and "data.pkl" in ends:
        return "a TorchScript module"
    if "data.pkl" in ends:
        return "a torch.save of weights or a module"
    return "an archive of numpy arrays" if all(name.endswith(".npy") for name in names) else "a zip archive"
