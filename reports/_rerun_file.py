"""A file that Rerun opens with a name and a layout of its own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from nathlon.sim.whole_file import write_whole


@contextmanager
def rerun_file(path: Path, identity: str, name: str, layout: rrb.Blueprint) -> Iterator[rr.RecordingStream]:
    """A stream whose content becomes the .rrd at `path`; a file of that name is replaced whole."""
    stream = rr.RecordingStream("nathlon", recording_id=identity, send_properties=False)
    # To a file, Rerun writes from a thread that waits for ever once the disk is full.
    written = rr.binary_stream(stream)
    # The viewer in a browser shows a layout that is only the default one as if there were none.
    stream.send_blueprint(layout, make_active=True)
    stream.send_recording_name(name)
    yield stream
    content = written.read()
    stream.disconnect()
    write_whole(path, content or b"")
