"""`nathlon serve`."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nathlon.commands.options import AsJson, Port, StoreName
from nathlon.sim.errors import InputError
from nathlon.sim.extras import need
from nathlon.terminal import print_json, say, warn

if TYPE_CHECKING:
    from nathlon.lab.serve.server import MeetingServer


def serve(
    store: StoreName,
    member: Annotated[
        list[str] | None,
        typer.Option(help="Member who may enter; may be repeated. The committee's members by default."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder of the nights or of the run; the store's by default."),
    ] = None,
    host: Annotated[
        str, typer.Option(help="Name or address by which browsers reach this machine.")
    ] = "127.0.0.1",
    port: Port = 0,
    cert: Annotated[Path | None, typer.Option(help="Certificate of the host (PEM), for TLS.")] = None,
    key: Annotated[Path | None, typer.Option(help="Key of the certificate (PEM).")] = None,
    as_json: AsJson = False,
) -> None:
    """Open the committee's room in a browser: report, questions, votes, blind drives, the log.

    Every member gets an address with a token of their own.
    """
    need("uvicorn", "drive", "the committee's room")
    from nathlon.lab.serve.folders import Folders
    from nathlon.lab.serve.record import RunsRecord
    from nathlon.lab.serve.server import serve_meeting
    from nathlon.lab.serve.tokens import Tokens
    from nathlon.lab.web.address import Address, is_loopback, is_unspecified
    from nathlon.lab.web.server import tls_context

    if (cert is None) != (key is None):
        raise InputError("--cert, --key: expected both or neither")
    if cert is None and not is_loopback(host):
        raise InputError(f"--host {host}: is beyond this machine, expected --cert and --key too")
    if is_unspecified(host):
        raise InputError(f"--host {host}: no browser calls it so, expected a name or address of this machine")
    tls = tls_context(cert, key) if cert and key else None
    record = RunsRecord(store, Folders(store, out))
    members = member or record.members()
    if not members:
        raise InputError(f"{store}: nobody has been asked to vote yet, expected --member NAME")

    def on_open(meeting: MeetingServer) -> None:
        urls = {name: meeting.url(name) for name in members}
        if as_json:
            print_json({"members": urls})
        else:
            for name, url in urls.items():
                say(f"{name:<12} {url}")
        # Whoever reads it through a pipe waits for it.
        sys.stdout.flush()
        warn("Give every member their own address, and nobody else's. Ctrl-C ends it.")

    address = Address(host.lower(), port, tls is not None)
    try:
        asyncio.run(serve_meeting(record, store, Tokens(members), address, tls, on_open))
    except KeyboardInterrupt:
        warn("Stopped.")
    finally:
        record.close()
