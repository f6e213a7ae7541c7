"""A language model for the tests: a local server that says what it was given."""

from __future__ import annotations

import json
import threading
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
                told = {"choices": [{"message": {"role": "assistant", "content": left.pop(0)}}]}
                answer = json.dumps(told if self.path == "/v1/chat/completions" else {}).encode()
                self.send_response(200)
                self.send_header("Content-Length", str(len(answer)))
                self.end_headers()
                self.wfile.write(answer)

            def log_message(self, format: str, *args: Any) -> None:
                pass

        self.server = HTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_port}/v1"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def close(self) -> None:
        """End it."""
        self.server.shutdown()
        self.server.server_close()
