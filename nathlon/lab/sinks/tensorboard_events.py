"""Nights as events of TensorBoard: a curve has a step for each night."""

from __future__ import annotations

import numpy as np
from PIL import Image
from torch.utils.tensorboard import SummaryWriter

from nathlon.lab.sinks.bulletin import PICTURE, Bulletin
from nathlon.lab.sinks.figures import figures
from nathlon.lab.sinks.messages import text


def log_night(bulletin: Bulletin, address: str) -> str:
    """Log a night; the folder.

    Args:
        bulletin: the night.
        address: folder of event files.
    """
    assert bulletin.folder is not None
    step = int(bulletin.folder.name.rpartition("-")[2])
    with SummaryWriter(address) as writer, Image.open(bulletin.folder / PICTURE) as picture:
        for name, value in figures(bulletin).items():
            writer.add_scalar(f"nights/{name}", value, step)
        writer.add_image("ranking", np.asarray(picture.convert("RGB")), step, dataformats="HWC")
        writer.add_text("verdict", text(bulletin), step)
    return address
