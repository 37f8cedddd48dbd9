"""A way to a server that breaks: a proxy for TCP which drops connections when it is told to."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from urllib.parse import urlsplit


class Flaky:
    """`limits` says how many bytes of each connection's answers go through before it is dropped; then none is."""

    def __init__(self, url: str, limits: list[int]) -> None:
        parts = urlsplit(url)
        self.server = (parts.hostname or "", parts.port or 80)
        self.limits = limits
        self.requests: list[str] = []
        """Heads of the requests that came, in lower case."""
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self.listener.accept()
                limit = self.limits.pop(0) if self.limits else None
                far = socket.create_connection(self.server)
                threading.Thread(target=self._forth, args=[near, far], daemon=True).start()
                threading.Thread(target=self._back, args=[near, far, limit], daemon=True).start()

    def _forth(self, near: socket.socket, far: socket.socket) -> None:
        with suppress(OSError):
            while piece := near.recv(1 << 16):
                if b" HTTP/1.1\r\n" in piece:
                    self.requests.append(piece.split(b"\r\n\r\n")[0].decode().lower())
                far.sendall(piece)
            far.shutdown(socket.SHUT_WR)

    def _back(self, near: socket.socket, far: socket.socket, limit: int | None) -> None:
        with suppress(OSError):
            while limit is None or limit > 0:
                piece = far.recv(1 << 16 if limit is None else limit)
                if not piece:
                    break
                near.sendall(piece)
                limit = None if limit is None else limit - len(piece)
            if limit == 0:
                # The answer is on its way; wait for it so that the server has surely done its work.
                far.recv(1)
        for end in (near, far):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()


@contextmanager
def flaky(url: str, limits: list[int]) -> Iterator[Flaky]:
    way = Flaky(url, limits)
    try:
        yield way
    finally:
        way.listener.close()
