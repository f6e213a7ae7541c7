"""Language models for the tests: local servers that say what they were given."""

from __future__ import annotations

import json
import socketserver
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any


class Model:
    """A server that speaks the chat interface, with replies that it was given.

    Attributes:
        heard: bodies and keys of the requests.
    """

    def __init__(self, replies: list[str]) -> None:
        self.heard: list[tuple[Any, str | None]] = []
        heard, left = self.heard, list(replies)

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
                heard.append((body, self.headers.get("Authorization")))
                told = saying(left.pop(0)) if self.path == "/v1/chat/completions" else "{}"
                self.send_response(200)
                self.send_header("Content-Length", str(len(told.encode())))
                self.end_headers()
                self.wfile.write(told.encode())

            def log_message(self, format: str, *args: Any) -> None:
                pass

        self.server = HTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_port}/v1"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def close(self) -> None:
        """End it."""
        self.server.shutdown()
        self.server.server_close()


@contextmanager
def raw_model(*answers: Iterable[bytes]) -> Iterator[tuple[str, list[bytes]]]:
    """A server that answers each request with bytes of its own, part by part, and then hangs up.

    Yields:
        its address, and the requests that it has got.
    """
    heard: list[bytes] = []
    left = list(answers)

    class Handler(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            head = b"".join(iter(self.rfile.readline, b"\r\n"))
            length = next(line for line in head.lower().split(b"\r\n") if line.startswith(b"content-length:"))
            heard.append(head + self.rfile.read(int(length.partition(b":")[2])))
            with suppress(OSError):  # who has heard enough hangs up
                for part in left.pop(0):
                    self.wfile.write(part)

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Handler) as server:
        server.daemon_threads = True
        thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}/v1", heard
        finally:
            server.shutdown()


def answer(code: int, body: bytes | str, **headers: str) -> list[bytes]:
    """What a server sends; an underscore in a header's name is a hyphen."""
    content = body.encode() if isinstance(body, str) else body
    lines = [f"{name.replace('_', '-')}: {value}" for name, value in headers.items()]
    head = [f"HTTP/1.1 {code} Told", f"Content-Length: {len(content)}", *lines, "", ""]
    return ["\r\n".join(head).encode() + content]


def saying(text: str) -> str:
    """The answer of a chat interface."""
    return json.dumps({"choices": [{"message": {"role": "assistant", "content": text}}]})
