"""The other end of a server's WebSocket, for tests."""

from __future__ import annotations

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection

PATIENCE_S = 60.0
CUT = 1006
"""Stands for a connection that has ended without a word."""


def closed(connection: ClientConnection) -> int:
    """The code with which the server ends a connection."""
    try:
        while True:
            connection.recv(timeout=PATIENCE_S)
    except ConnectionClosed as end:
        return int(end.rcvd.code) if end.rcvd else CUT
