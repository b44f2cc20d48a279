"""TLS in front of a server on loopback that knows none."""

from __future__ import annotations

import asyncio
import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from cli.broker import LOOPBACK


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
    loop = asyncio.new_event_loop()

    async def pipe(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while piece := await reader.read(65_536):
                writer.write(piece)
                await writer.drain()
        writer.close()

    async def hand_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        behind_reader, behind_writer = await asyncio.open_connection(LOOPBACK, port)
        await asyncio.gather(pipe(reader, behind_writer), pipe(behind_reader, writer))

    async def listen() -> asyncio.Server:
        return await asyncio.start_server(hand_on, LOOPBACK, 0, ssl=context)

    async def end(server: asyncio.Server) -> None:
        server.close()
        left = asyncio.all_tasks() - {asyncio.current_task()}
        for task in left:
            task.cancel()
        await asyncio.gather(*left, return_exceptions=True)

    server = loop.run_until_complete(listen())
    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        asyncio.run_coroutine_threadsafe(end(server), loop).result(10.0)
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
