"""A film as a video that every browser plays."""

from __future__ import annotations

import io
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from nathlon.arena.film import RATE, Film
from nathlon.sim.whole_file import whole_file, writing

TICKS = 1000
"""Of the video's clock in a second."""
LAST_S = 1.0
"""For which the last picture stays."""
OPTIONS = {"crf": "28", "b": "0", "deadline": "realtime", "cpu-used": "6", "row-mt": "1"}


def write_film_video(film: Film, path: Path) -> None:
    """Write a film as WebM (VP9), which browsers play that lack H.264; every picture at its time.

    Args:
        film: the film.
        path: the file; one of that name is replaced whole.

    Raises:
        InputError: if it cannot be written, or a picture is none.
    """
    # An OSError is of the disk, or of a picture that is none.
    with (
        writing(path, "video"),
        whole_file(path) as partial,
        av.open(str(partial), "w", format="webm") as container,
    ):
        stream = container.add_stream("libvpx-vp9", rate=round(RATE), options=OPTIONS)
        stream.height, stream.width = _picture(film.pictures[0]).shape[:2]
        stream.codec_context.time_base = Fraction(1, TICKS)
        stream.pix_fmt = "yuv420p"
        times = [*film.time_s, film.time_s[-1] + LAST_S]
        for time_s, jpeg in zip(times, [*film.pictures, film.pictures[-1]], strict=True):
            frame = av.VideoFrame.from_ndarray(_picture(jpeg), "rgb24")
            frame.pts, frame.time_base = round((time_s - film.time_s[0]) * TICKS), Fraction(1, TICKS)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def _picture(jpeg: bytes) -> NDArray[np.uint8]:
    """(height, width, 3) uint8, of even height and width, as the encoder wants them."""
    picture = np.asarray(Image.open(io.BytesIO(jpeg), formats=["JPEG"]).convert("RGB"))
    height, width = picture.shape[:2]
    return np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
