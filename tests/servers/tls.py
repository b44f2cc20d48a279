"""TLS in front of a server on loopback that knows none."""

from __future__ import annotations

import select
import socket
import socketserver
import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from morphid.broker import LOOPBACK

POLL_S = 0.1


@contextmanager
def tls_front(port: int, context: ssl.SSLContext) -> Iterator[int]:
    """Take TLS connections and hand on what comes in them.

    Parameters
    ----------
    port : of the server behind.
    context : with the certificate to be shown.

    Yields
    ------
    The port that speaks TLS.
    """
    over = threading.Event()

    class HandOn(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            try:
                with (
                    context.wrap_socket(self.request, server_side=True) as front,
                    socket.create_connection((LOOPBACK, port), timeout=5.0) as behind,
                ):
                    pump(front, behind)
            except OSError:
                return  # who does not trust the certificate hangs up

    def pump(front: ssl.SSLSocket, behind: socket.socket) -> None:
        while not over.is_set():
            waiting = [front] if front.pending() else select.select([front, behind], [], [], POLL_S)[0]
            for source in waiting:
                piece = source.recv(65_536)
                if not piece:
                    return
                (behind if source is front else front).sendall(piece)

    with socketserver.ThreadingTCPServer((LOOPBACK, 0), HandOn) as server:
        thread = threading.Thread(target=server.serve_forever, args=(POLL_S,))
        thread.start()
        try:
            yield server.server_address[1]
        finally:
            over.set()
            server.shutdown()
            thread.join()
