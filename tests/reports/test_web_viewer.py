"""Rerun's viewer in the browser, for this machine alone."""

from __future__ import annotations

import http.client
import io
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import sync_playwright

from nathlon.reports._blueprint import SKY
from nathlon.reports.replay import write_replay
from nathlon.reports.web_viewer import LOOPBACK, WebViewer
from nathlon.sim.errors import InputError
from tests.support.race_logs import oval_race

PATIENCE_S = 120.0
SOFTWARE_GL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")


@pytest.fixture(scope="module")
def replay(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("web") / "race.rrd"
    write_replay(oval_race(cars=2, duration_s=5.0), path)
    return path


@pytest.fixture(scope="module")
def viewer(replay: Path) -> Iterator[WebViewer]:
    with WebViewer(replay) as viewer:
        thread = threading.Thread(target=viewer.serve_forever)
        thread.start()
        yield viewer
        viewer.shutdown()
        thread.join()


def get(viewer: WebViewer, path: str, host: str | None = None) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection(LOOPBACK, viewer.server_port, timeout=20)
    connection.request("GET", path, headers={} if host is None else {"Host": host})
    return connection.getresponse()


def test_it_listens_on_loopback_only(viewer: WebViewer) -> None:
    assert viewer.socket.getsockname()[0] == "127.0.0.1"
    port = f":{viewer.server_port:04X}"
    for table in (Path("/proc/net/tcp"), Path("/proc/net/tcp6")):
        if table.exists():
            local = [
                line.split()[1] for line in table.read_text().splitlines()[1:] if line.split()[3] == "0A"
            ]
            assert {at for at in local if at.endswith(port)} <= {f"0100007F{port}"}


def test_it_serves_the_viewer_and_the_replay(viewer: WebViewer, replay: Path) -> None:
    assert get(viewer, "/race.rrd").read() == replay.read_bytes()
    wasm = get(viewer, "/re_viewer_bg.wasm")
    assert wasm.getheader("Content-Type") == "application/wasm"
    assert wasm.read(4) == b"\0asm"
    page = get(viewer, "/")
    assert "connect-src 'self'" in (page.getheader("Content-Security-Policy") or "")
    assert b"re_viewer.js" in page.read()


def test_it_serves_nothing_else_and_nobody_else(viewer: WebViewer) -> None:
    for path in ("/../pyproject.toml", "/etc/passwd", "/race"):
        assert get(viewer, path).status == 404
    assert get(viewer, "/race.rrd", host="evil.example").status == 403


def test_the_browser_shows_the_layout_of_the_replay_and_asks_nobody_else(
    viewer: WebViewer, chromium: str
) -> None:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", *SOFTWARE_GL])
        page = browser.new_page(viewport={"width": 800, "height": 600})
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        with page.expect_response(f"{viewer.url}race.rrd", timeout=120_000) as response:
            page.goto(viewer.url)
        assert response.value.ok
        # Of all that Rerun would lay out by itself, nothing has the colour of the sky behind the car.
        until = time.monotonic() + PATIENCE_S
        while (sky := _share(page.screenshot(timeout=PATIENCE_S * 1000), SKY)) < 0.05:
            assert time.monotonic() < until, f"sky on {sky:.1%} of the picture"
        assert all(url.startswith((viewer.url, "data:", "blob:")) for url in asked), asked
        browser.close()


def _share(picture: bytes, colour: tuple[int, int, int]) -> float:
    """Of the pixels of a picture that have about this colour."""
    pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")).astype(int)
    return float((np.abs(pixels - colour).max(axis=2) <= 12).mean())


def test_a_replay_that_is_missing_is_said_to_be(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.rrd cannot be read: No such file"):
        WebViewer(tmp_path / "none.rrd")


def test_the_port_is_free_again_when_it_is_closed(replay: Path) -> None:
    with WebViewer(replay) as viewer:
        port = viewer.server_port
    with socket.socket() as free:
        free.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        free.bind((LOOPBACK, port))
