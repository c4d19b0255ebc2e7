"""An S3 server that stores what it receives and ignores every condition, signature and credential."""

import hashlib
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread


@dataclass(frozen=True)
class LaxServer:
    """Its address, and the session token of each request so far."""

    url: str
    tokens: list[str | None]


class _LaxHandler(BaseHTTPRequestHandler):
    objects: dict[str, bytes]
    tokens: list[str | None]

    def do_PUT(self) -> None:
        self.objects[self.path] = self.rfile.read(int(self.headers["Content-Length"]))
        self._answer(200, b"")

    def do_GET(self) -> None:
        self._answer(200 if self.path in self.objects else 404, self.objects.get(self.path, b""))

    def do_HEAD(self) -> None:
        self.do_GET()

    def do_DELETE(self) -> None:
        self.objects.pop(self.path, None)
        self._answer(204, b"")

    def do_POST(self) -> None:
        request = self.rfile.read(int(self.headers["Content-Length"])).decode()
        deleted = [f"<Deleted><Key>{key}</Key></Deleted>" for key in re.findall(r"<Key>(.*?)</Key>", request)]
        self._answer(200, f"<DeleteResult>{''.join(deleted)}</DeleteResult>".encode())

    def log_message(self, *_: object) -> None:
        """Log nothing."""

    def _answer(self, status: int, body: bytes) -> None:
        self.tokens.append(self.headers.get("x-amz-security-token"))
        self.send_response(status)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("ETag", f'"{hashlib.md5(body).hexdigest()}"')
        self.send_header("Last-Modified", "Sat, 01 Jan 2000 00:00:00 GMT")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)


@contextmanager
def lax_server() -> Iterator[LaxServer]:
    """Yield the server while it runs."""
    tokens = list[str | None]()
    handler = type("LaxHandler", (_LaxHandler,), {"objects": {}, "tokens": tokens})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield LaxServer(f"http://127.0.0.1:{server.server_port}", tokens)
        server.shutdown()
