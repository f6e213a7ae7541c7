"""Rerun's web viewer on this machine alone: a replay in the browser, without a network.

The viewer's own server listens on all interfaces unless told otherwise, keeps a core busy, and its page
fetches fonts and reports home. So its files are taken from it once, and served from here with a page whose
policy lets it load nothing else.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import NamedTuple
from urllib.error import URLError
from urllib.request import urlopen

from nathlon.policies.hosting.programs import end, start
from nathlon.reports.es_modules import bundle
from nathlon.sim.errors import InputError
from nathlon.sim.process import command_of

LOOPBACK = "127.0.0.1"
VIEWER_FILES = {"re_viewer.js": "text/javascript", "re_viewer_bg.wasm": "application/wasm"}
TEMPLATES = Path(__file__).parent / "templates"
POLICY = (
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'unsafe-inline'; "
    "connect-src 'self' blob: data:; img-src 'self' blob: data:; worker-src 'self' blob:; "
    "base-uri 'none'; form-action 'none'"
)
ANSWER_S = 30.0


class Served(NamedTuple):
    """A file to be served, and what kind it is."""

    kind: str
    content: bytes


class WebViewer(ThreadingHTTPServer):
    """Serves the viewer with one replay on a free port of the loopback interface, until it is closed.

    Attributes:
        url: of the page.
    """

    daemon_threads = True

    def __init__(self, replay: Path) -> None:
        """Raises InputError if the replay cannot be read or Rerun does not hand out its viewer."""
        try:
            race = replay.read_bytes()
        except OSError as error:
            raise InputError(f"{replay} cannot be read: {error.strerror}.") from None
        self.files: Mapping[str, Served] = {
            "/": Served("text/html; charset=utf-8", (TEMPLATES / "web_viewer.html").read_bytes()),
            "/web_viewer.js": Served("text/javascript", bundle(TEMPLATES, "web_viewer.js").encode()),
            "/race.rrd": Served("application/octet-stream", race),
            **{f"/{name}": file for name, file in _viewer_files().items()},
        }
        super().__init__((LOOPBACK, 0), _Handler)
        self.url = f"http://{LOOPBACK}:{self.server_port}/"


class _Handler(BaseHTTPRequestHandler):
    server: WebViewer

    def do_GET(self) -> None:
        # Another name for this machine may be a stranger's page that has found the port.
        local = self.headers.get("Host") == f"{LOOPBACK}:{self.server.server_port}"
        file = self.server.files.get(self.path.partition("?")[0])
        if not local or file is None:
            self.send_error(HTTPStatus.FORBIDDEN if not local else HTTPStatus.NOT_FOUND)
            return
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", file.kind)
        self.send_header("Content-Length", str(len(file.content)))
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        # A browser may go away at any time.
        with suppress(ConnectionError):
            self.wfile.write(file.content)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing: the terminal is the user's."""


@lru_cache
def _viewer_files() -> dict[str, Served]:
    """The files of the viewer that is built into the `rerun` program, by name."""
    command = command_of("rerun", "--serve-web", "--bind", LOOPBACK)
    command += ["--port", "0", "--web-viewer-port", "0"]
    viewer = start(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        said = ""
        for line in viewer.stderr or ():
            said = line.decode("utf-8", "replace")
            found = re.search(r"Hosting a web-viewer at (http://127\.0\.0\.1:\d+)", said)
            if found:
                return {
                    name: Served(kind, urlopen(f"{found[1]}/{name}", timeout=ANSWER_S).read())
                    for name, kind in VIEWER_FILES.items()
                }
        raise InputError(f"Rerun's web viewer does not start here: {said.strip() or 'it gave no reason'}")
    except URLError as error:
        raise InputError(f"Rerun's web viewer does not answer: {error.reason}") from None
    finally:
        end(viewer)
