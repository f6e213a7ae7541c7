"""What the room's server answers to requests for pages and files."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from starlette.requests import Request
from starlette.responses import FileResponse, Response

from nathlon.arena.recording import read_recording
from nathlon.arena.store import Store
from nathlon.lab.drive.page import drive_page
from nathlon.lab.serve.api import answer_api
from nathlon.lab.serve.folders import shown_file
from nathlon.lab.serve.live_report import live_report
from nathlon.lab.serve.page import room_page
from nathlon.lab.serve.record import RUNS
from nathlon.lab.serve.tokens import Tokens
from nathlon.lab.web.access import answer, headers, path_of
from nathlon.lab.web.address import Address
from nathlon.reports.player import render_player
from nathlon.selection.publish.output import POLICY_LOG
from nathlon.sim.errors import InputError

BEARER = "bearer"
FRAMED = "'self'"
ALONE = f"{FRAMED}; sandbox allow-scripts allow-downloads"
"""A file of a run's folder has no part in the room, also in its frame: others may have written it."""
WATCH, PLAYER = "watch", ".html"
"""Where recordings are played, and what the addresses of these pages end with."""


class Files:
    """Pages and files of the room.

    Args:
        address: of the server.
        store: whose committee meets.
        tokens: of its members.
        folder: tells the folder of a run; None where there is none.
        version: tells what changes when a run's report would; KeyError for no run.
        asked: has a function of the store called.
    """

    def __init__(
        self,
        address: Address,
        store: str,
        tokens: Tokens,
        folder: Callable[[str], Awaitable[Path | None]],
        version: Callable[[str], Awaitable[str]],
        asked: Callable[[Callable[[Store], Any]], Awaitable[Any]],
    ) -> None:
        self._asked = asked
        self._address, self._store, self._tokens = address, store, tokens
        self._folder, self._version = folder, version
        self._report_made: tuple[str, bytes] | None = None
        self._cookie = f"nathlon-{address.port}"
        self._page = room_page(address, store).encode()
        self._rendering = asyncio.Lock()

    async def answer(self, request: Request) -> Response:
        """The answer to a request that has been let in."""
        parts = path_of(request)
        match parts:
            case [""]:
                return answer(HTTPStatus.OK, self._page)
            case ["enter"]:
                return self._enter(request)
            case ["api", name]:
                if self._member(request) is None:
                    return answer(HTTPStatus.FORBIDDEN)
                return await answer_api(request, name, self._asked)
            case ["drive", run]:
                socket = f"{self._address.socket}/drive/{run}"
                page = drive_page(socket, self._address.socket, token=None, room="/")
                return answer(HTTPStatus.OK, page.encode())
            case [first, run, _, *_] if first == RUNS:
                if not self._has_pass(request):
                    return answer(HTTPStatus.FORBIDDEN)
                return await self._file(unquote(run), parts[2:])
        return answer(HTTPStatus.NOT_FOUND)

    def _enter(self, request: Request) -> Response:
        """Hand a member's browser the pass with which it gets files; the token comes in a header."""
        member = self._member(request)
        if member is None:
            return answer(HTTPStatus.FORBIDDEN)
        cookie = f"{self._cookie}={self._tokens.pass_of(member)}; Path=/{RUNS}/; HttpOnly; SameSite=Strict"
        return answer(HTTPStatus.NO_CONTENT, Set_Cookie=f"{cookie}; Secure" if self._address.tls else cookie)

    def _member(self, request: Request) -> str | None:
        """Whose token a request has in a header, where no page of others can put it."""
        scheme, _, given = request.headers.get("Authorization", "").partition(" ")
        return self._tokens.member(given) if scheme.lower() == BEARER else None

    def _has_pass(self, request: Request) -> bool:
        try:
            cookies = SimpleCookie("; ".join(request.headers.getlist("Cookie")))
        except CookieError:
            return False
        given = cookies.get(self._cookie)
        return given is not None and self._tokens.reader(given.value) is not None

    async def _file(self, run: str, parts: list[str]) -> Response:
        folder = await self._folder(run)
        if parts == ["report", "index.html"]:
            return await self._report(run, folder)
        if parts[0] == WATCH and parts[1:]:
            return await self._player(folder, parts[1:])
        found = folder and shown_file(folder, parts)
        if not found:
            return answer(HTTPStatus.NOT_FOUND)
        path, kind = found
        try:
            response = FileResponse(path, 200, headers(ALONE), kind, stat_result=path.stat())
        except OSError:  # it has just been removed
            return answer(HTTPStatus.NOT_FOUND)
        if parts == [POLICY_LOG]:
            # It may grow meanwhile.
            del response.headers["Content-Length"]
        return response

    async def _player(self, folder: Path | None, parts: list[str]) -> Response:
        """The page that plays a recording, which has no page in the folder."""
        found = folder and shown_file(folder, [*parts[:-1], parts[-1].removesuffix(PLAYER)])
        if not found:
            return answer(HTTPStatus.NOT_FOUND)
        async with self._rendering:
            try:
                page = await asyncio.to_thread(lambda: render_player(read_recording(found[0])))
            except InputError:
                return answer(HTTPStatus.NOT_FOUND)
        return answer(HTTPStatus.OK, page.encode(), frames=ALONE)

    async def _report(self, run: str, folder: Path | None) -> Response:
        # One at a time, and once for all who look: each takes a core for some seconds.
        async with self._rendering:
            try:
                version = await self._version(run)
                if self._report_made is None or self._report_made[0] != version:
                    page = await asyncio.to_thread(live_report, self._store, run, folder)
                    self._report_made = version, page.encode()
            except (InputError, KeyError):
                return answer(HTTPStatus.NOT_FOUND)
            return answer(HTTPStatus.OK, self._report_made[1], frames=FRAMED)
