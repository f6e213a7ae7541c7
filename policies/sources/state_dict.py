"""The tensors that `torch.save` wrote, read as data.

Such a file is a zip with a pickle that puts the tensors together. The pickle may name what a plain table of
tensors is made of and no more, and torch gets the members packed anew, so that it sees what was checked.
torch has written zips since 1.6 (2020); the format before is not read.
"""

from __future__ import annotations

import io
import pickletools
import re
import zipfile
from typing import Any

from nathlon.policies.sources.archive import unpack

MOST_PICKLE = 1 << 20
"""Bytes of the pickle; that of a multilayer perceptron has some thousands."""
MOST_NAMES = 4
"""Of a tensor: what actor and critic share is stored once."""

_PLAIN = re.compile(r"collections OrderedDict|torch\._utils _rebuild_tensor_v2|torch \w+Storage")
"""What the pickle of plain tensors names, as `pickletools` shows it."""


def read_state_dict(content: bytes) -> dict[str, Any]:
    """The tensors of a state dict by name, on the CPU.

    Raises:
        ValueError: if it is damaged, holds anything else, or has tensors of more numbers than it stores.
        MemoryError: if there is too little.
    """
    import torch  # takes seconds: only those who race such a file wait

    try:
        members = unpack(content)
        _check_pickle(members)
        found = torch.load(_packed(members), map_location="cpu", weights_only=True)
    except MemoryError:
        raise
    # Damaged weights make torch raise almost anything.
    except Exception as error:
        raise ValueError(str(error).partition("\n")[0]) from None
    if not isinstance(found, dict):
        raise ValueError("it holds no tensors by name")
    # Not the object's own methods: attributes from the file may stand in their place.
    tensors = dict(dict.items(found))
    if not all(isinstance(name, str) for name in tensors):
        raise ValueError("a tensor's name is no text")
    claimed = sum(t.numel() * t.element_size() for t in tensors.values() if isinstance(t, torch.Tensor))
    stored = MOST_NAMES * sum(map(len, members.values()))
    if claimed > stored:
        raise ValueError(
            f"its tensors have {claimed} bytes, of which it stores {stored // MOST_NAMES}: more than the "
            "actor, the critics and their targets can share"
        )
    return tensors


def _check_pickle(members: dict[str, bytes]) -> None:
    # torch looks it up without regard to case.
    pickles = [member for name, member in members.items() if name.lower().endswith("data.pkl")]
    if len(pickles) != 1 or len(pickles[0]) > MOST_PICKLE:
        raise ValueError(f"expected one data.pkl of at most {MOST_PICKLE} bytes")
    for opcode, argument, _ in pickletools.genops(pickles[0]):
        if opcode.name == "GLOBAL" and not _PLAIN.fullmatch(str(argument)):
            raise ValueError(f"it names {argument}, expected plain tensors")


def _packed(members: dict[str, bytes]) -> io.BytesIO:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name, member in members.items():
            archive.writestr(name, member)
    packed.seek(0)
    return packed
