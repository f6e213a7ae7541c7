"""Databases for the tests of the store; the PostgreSQL server is the test session's own, on a socket."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import psycopg
import pytest

from nathlon.sim.process import owner

ADMIN = "nathlon"
UNPRIVILEGED = "nobody"  # runs the server where the tests run as root, which it refuses


def _programs() -> Path | None:
    """The folder with the server's programs."""
    installed = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    found = shutil.which("initdb") or (str(installed[-1]) if installed else None)
    return Path(found).resolve().parent if found else None


@dataclass(frozen=True)
class Server:
    """A PostgreSQL server of the tests.

    Attributes:
        url: of its databases, with braces where their names go.
        call: calls one of its programs with arguments.
        options: to start it with.
    """

    folder: Path
    url: str
    call: Callable[..., None]
    options: str

    def start(self) -> None:
        self.call("pg_ctl", "start", "-w", "-l", str(self.folder / "log"), "-o", self.options)

    def stop(self) -> None:
        """End it as if its machine were switched off."""
        self.call("pg_ctl", "stop", "-m", "immediate")


@pytest.fixture(scope="session")
def server() -> Iterator[Server]:
    """A server; skips the test where PostgreSQL is not installed."""
    programs = _programs()
    if programs is None:
        pytest.skip("needs PostgreSQL: apt-get install postgresql")
    folder = Path(tempfile.mkdtemp(prefix=f"nathlon-{owner()}-postgres-"))
    user = UNPRIVILEGED if os.geteuid() == 0 else None
    if user:
        shutil.chown(folder, user)

    def call(program: str, *arguments: str) -> None:
        command = [str(programs / program), "-D", str(folder / "data"), *arguments]
        subprocess.run(command, check=True, user=user, cwd=folder, stdout=subprocess.DEVNULL)

    url = f"postgresql+psycopg://{ADMIN}@/{{}}?host={folder}"
    server = Server(folder, url, call, f"-k {folder} -c listen_addresses='' -c fsync=off")
    try:
        call("initdb", "-U", ADMIN, "-A", "trust", "-E", "UTF8", "--locale=C.UTF-8", "--no-sync")
        server.start()
        try:
            yield server
        finally:
            server.stop()
    finally:
        shutil.rmtree(folder)


@pytest.fixture(scope="session")
def postgres_server(server: Server) -> str:
    """The URL of a server, without a database."""
    return server.url


_numbers = count()


@pytest.fixture
def postgres(postgres_server: str) -> Iterator[str]:
    """The URL of an empty database."""
    name = f"test_{next(_numbers)}"
    server = postgres_server.format("postgres").replace("+psycopg", "")
    with psycopg.connect(server, autocommit=True) as connection:
        connection.execute(f"CREATE DATABASE {name}")
    yield postgres_server.format(name)
    with psycopg.connect(server, autocommit=True) as connection:
        connection.execute(f"DROP DATABASE {name} WITH (FORCE)")


@pytest.fixture(params=["sqlite", "postgresql"])
def target(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Where there is no store yet: the path of a file and the URL of a database in turn."""
    if request.param == "sqlite":
        return str(tmp_path / "new" / "folders" / "store.sqlite")
    url: str = request.getfixturevalue("postgres")
    return url
