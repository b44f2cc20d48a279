"""The server process: uvicorn with limits on slow clients. ``python -m app.http.server --host --port``.

Uvicorn itself waits indefinitely for headers and for slow readers. Requests are parsed by h11, which bounds
the size of headers and rejects ambiguous requests; the faster parser does neither.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import re
import resource
import socket
import sys
from functools import partial
from typing import Any

import h11
import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle

from app.errors import HttpError, ServiceBusy, ServiceError
from app.http.problems import closing_answer
from app.observability.logs import configure_logging
from app.settings import Settings, doubtful_variables, settings_or_exit

MAX_HEADER_BYTES = 32 * 1024  # request line and headers
END_OF_HEADERS = re.compile(rb"\n\r?\n")
LINGER_S = 1.0  # s to read a response sent before the end of the request
MIN_READ_RATE = 4096.0  # bytes per second that a client must read of a waiting response
DEAD_PEER_S = 60.0  # s; a peer whose system does not answer is gone
KEEP_ALIVE_S = 5
STOP_S = 5  # s for open responses when the process shuts down
DRAIN_S = 1.0  # s after that for requests in transit on idle connections
SPARE_FILES = 200  # for databases, brokers, uploads, logs

SLOW_HEADERS = HttpError(
    408,
    "slow_headers",
    "The headers of the request did not arrive in time",
    hint="Send the request in one go.",
)
LARGE_HEADERS = HttpError(
    431,
    "headers_too_large",
    "The headers of the request are too large",
    hint=f"Send at most {MAX_HEADER_BYTES // 1024} KiB of headers, the line with the address included.",
)
LONG_ADDRESS = HttpError(
    414,
    "address_too_long",
    "The address of the request is too long",
    hint=f"Send at most {MAX_HEADER_BYTES // 1024} KiB; send long data in the body.",
)
BAD_REQUEST = HttpError(
    400,
    "bad_request",
    "This is not an HTTP request",
    hint="Escape the URL and send a valid HTTP/1.1 request.",
)

logger = logging.getLogger(__name__)


class BoundedConnection(h11.Connection):
    """A parser that bounds the size of headers, however they arrive.

    h11 itself checks the size of incomplete data only: headers of any size pass if they arrive in one piece.
    """

    def _extract_next_receive_event(self) -> Any:
        before = len(self._receive_buffer)
        if self.their_state is h11.IDLE and before > MAX_HEADER_BYTES:
            beginning = self.trailing_data[0][:MAX_HEADER_BYTES]
            if b"\n" not in beginning:
                raise _too_large(LONG_ADDRESS)
            if END_OF_HEADERS.search(beginning) is None:
                raise _too_large(LARGE_HEADERS)
        event = super()._extract_next_receive_event()
        taken = before - len(self._receive_buffer)
        if isinstance(event, h11.Data):
            taken -= len(event.data)
        if taken > MAX_HEADER_BYTES:  # fields after a chunked body, or in one of its chunks
            raise _too_large(LARGE_HEADERS)
        return event


def _too_large(error: HttpError) -> h11.RemoteProtocolError:
    return h11.RemoteProtocolError(error.detail, error_status_hint=error.status)


class GuardedConfig(uvicorn.Config):
    """Uvicorn's configuration with the limits that `settings` put on connections."""

    def __init__(self, app: Any, settings: Settings, **others: Any) -> None:
        super().__init__(
            app,
            http=GuardedProtocol,
            ws="none",
            timeout_keep_alive=KEEP_ALIVE_S,
            server_header=False,
            access_log=False,
            # a kept-alive connection would pass the trace of its last request to the next one
            reset_contextvars=True,
            **others,
        )
        self.max_connections = connection_limit(settings.max_connections)
        self.header_timeout_s = settings.header_timeout_s
        self.write_timeout_s = settings.write_timeout_s


class GuardedProtocol(H11Protocol):
    """One connection with time limits for headers and readers."""

    def __init__(self, config: GuardedConfig, *others: Any, **named: Any) -> None:
        super().__init__(config, *others, **named)
        self.conn = BoundedConnection(h11.SERVER, MAX_HEADER_BYTES)
        self.config: GuardedConfig = config
        self._header_timer: asyncio.TimerHandle | None = None
        self._write_timer: asyncio.TimerHandle | None = None
        self._linger_timer: asyncio.TimerHandle | None = None
        self._drain_timer: asyncio.TimerHandle | None = None
        self._unread = 0  # bytes waiting for the client at the last check
        self._lingering: RequestResponseCycle | None = None  # whose request went on after its response
        self._refused = False
        self._ending = False

    # a connection begins and ends

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Accept a connection, or refuse it if there are too many."""
        super().connection_made(transport)
        _notice_dead_peers(transport)
        if len(self.connections) > self.config.max_connections:
            self._refuse(ServiceBusy("There are too many connections to this service."))
            self.transport.close()  # closed at once, since lingering would add to their number
        else:
            self._header_timer = self.loop.call_later(self.config.header_timeout_s, self._headers_late)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._cancel("_header_timer", "_write_timer", "_linger_timer", "_drain_timer")
        self._unset_keepalive_if_required()
        super().connection_lost(exc)

    def shutdown(self) -> None:
        """Shut down with the server, after open responses and requests whose first byte is still in transit.

        Closing an idle connection at once would lose a request that its client is just sending.
        """
        self._ending = True
        # None before the first request, whatever its annotation says
        if self.cycle is None or self.cycle.response_complete:  # type: ignore[redundant-expr]
            self._drain_timer = self.loop.call_later(DRAIN_S, super().shutdown)
        else:
            super().shutdown()

    # headers

    def data_received(self, data: bytes) -> None:
        """Read a piece; the time limit for headers runs from a request's first byte and is never extended."""
        if self._refused or self.transport.is_closing():
            return
        if self._header_timer is None and self._between_requests():
            self._header_timer = self.loop.call_later(self.config.header_timeout_s, self._headers_late)
        super().data_received(data)
        if self._ending and self.cycle is not None:
            self.cycle.keep_alive = False
        if not self._between_requests():
            self._cancel("_header_timer")
        # the late rest of a request may come together with the next request
        if self._between_requests() or self.cycle is not self._lingering:
            self._cancel("_linger_timer")

    def _between_requests(self) -> bool:
        return self.conn.their_state is h11.IDLE

    def _headers_late(self) -> None:
        self._header_timer = None
        if self.conn.trailing_data[0]:
            self._refuse(SLOW_HEADERS)
        else:
            self.transport.close()

    def send_400_response(self, msg: str) -> None:  # noqa: ARG002 - uvicorn's message; ours is more specific
        """Respond to an invalid request with a problem document, unless a response has begun."""
        # called where the parser's error is handled
        status = getattr(sys.exception(), "error_status_hint", None)
        found = (error for error in (LARGE_HEADERS, LONG_ADDRESS) if error.status == status)
        self._refuse(next(found, BAD_REQUEST))

    def _refuse(self, error: ServiceError) -> None:
        """Respond and close; a client that is still sending gets time to read the response."""
        self._refused = True
        self._cancel("_header_timer")
        if self.conn.our_state not in (h11.IDLE, h11.SEND_RESPONSE):  # another response is in progress
            self.transport.close()
            return
        # None before the first request, whatever its annotation says
        if self.cycle is not None and not self.cycle.response_complete:  # type: ignore[redundant-expr]
            # the application waits for the rest of the body; its response would come too late
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        self.transport.write(_answer(error))
        if self.transport.can_write_eof():
            self.transport.write_eof()
        self._linger_timer = self.loop.call_later(LINGER_S, self.transport.close)

    # answers

    def on_response_complete(self) -> None:
        """Close the connection soon if the client still sends a request that was already answered."""
        still_sending = self.conn.their_state is h11.SEND_BODY
        super().on_response_complete()
        if still_sending and not self.transport.is_closing():
            self._lingering = self.cycle
            self._linger_timer = self.loop.call_later(LINGER_S, self.transport.close)

    def pause_writing(self) -> None:
        """Watch a client that does not read."""
        super().pause_writing()
        self._unread = self.transport.get_write_buffer_size()
        self._write_timer = self.loop.call_later(self.config.write_timeout_s, self._look_at_reader)

    def resume_writing(self) -> None:
        """The client has read."""
        self._cancel("_write_timer")
        super().resume_writing()

    def _look_at_reader(self) -> None:
        unread = self.transport.get_write_buffer_size()
        if self._unread - unread < MIN_READ_RATE * self.config.write_timeout_s:
            logger.info("disconnected a client that does not read its response")
            self.transport.abort()
            return
        self._unread = unread
        self._write_timer = self.loop.call_later(self.config.write_timeout_s, self._look_at_reader)

    def _cancel(self, *timers: str) -> None:
        for name in timers:
            timer: asyncio.TimerHandle | None = getattr(self, name)
            if timer is not None:
                timer.cancel()
                setattr(self, name, None)


def _answer(error: ServiceError) -> bytes:
    headers, content = closing_answer(error, "")
    lines = [f"HTTP/1.1 {error.status} ", *(f"{name}: {value}" for name, value in headers.items()), "", ""]
    return "\r\n".join(lines).encode() + content


def _notice_dead_peers(transport: asyncio.Transport) -> None:
    """Let the system close connections whose peer vanished silently."""
    connection: socket.socket | None = transport.get_extra_info("socket")
    if connection is None or connection.family not in (socket.AF_INET, socket.AF_INET6):
        return
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in (("TCP_KEEPIDLE", int(DEAD_PEER_S)), ("TCP_USER_TIMEOUT", int(1000 * DEAD_PEER_S))):
        if hasattr(socket, name):  # not on every system
            connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


def connection_limit(requested: int) -> int:
    """Raise the process's limit of open files to its maximum, and bound connections by it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    needed = requested + SPARE_FILES
    if soft == resource.RLIM_INFINITY or soft >= needed:
        return requested
    soft = needed if hard == resource.RLIM_INFINITY else min(needed, hard)
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    return max(1, min(requested, soft - SPARE_FILES))


def _application(settings: Settings) -> Any:
    """Build the service for its own process, which therefore logs in the service's format."""
    from app.main import create_app

    configure_logging(settings.log_format, settings.log_level)
    for sentence in doubtful_variables():
        logger.warning(sentence)
    return create_app(settings)


def main(arguments: list[str] | None = None) -> None:
    """Serve until SIGTERM or SIGINT."""
    parser = argparse.ArgumentParser(prog="python -m app.http.server", description="Serve the API.")
    parser.add_argument("--host", help="MORPHID_HOST where it is left out")
    parser.add_argument("--port", type=int, help="MORPHID_PORT where it is left out")
    options = parser.parse_args(arguments)
    settings = settings_or_exit(host=options.host, port=options.port)
    config = GuardedConfig(
        # the options also determine whether keys are required
        partial(_application, settings),
        settings,
        factory=True,
        host=settings.host,
        port=settings.port,
        timeout_graceful_shutdown=STOP_S,
    )
    server = uvicorn.Server(config)
    server.run()
    if not server.started:
        sys.exit(uvicorn.config.STARTUP_FAILURE)


if __name__ == "__main__":
    main()
