"""One POST to an untrusted receiver: pinned address, verified name, no redirects, short timeouts."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import ssl
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

from app.webhooks.addresses import AddressPolicy, AddressRefused, Target
from app.webhooks.retries import parse_retry_after
from morphdata.version import VERSION

if TYPE_CHECKING:
    import httpx

MAX_ANSWER_BYTES = 64 * 1024  # bytes read, so that the receiver can finish its response, and discarded
MAX_ADDRESSES = 3  # addresses of a name, tried one after the other
GONE = 410
NOT_ECHOED = "The receiver did not answer with the challenge."


@dataclass(frozen=True, slots=True)
class Timeouts:
    """How long one try may last, s; `total_s` counts from the look-up to the last byte."""

    connect_s: float = 4.0
    read_s: float = 8.0
    total_s: float = 10.0


@dataclass(frozen=True, slots=True)
class Answer:
    """The outcome of one try."""

    status: int | None  # of HTTP; None if there was no response
    error: str | None = None  # why the try failed, without quoting the receiver
    retry_after_s: float | None = None  # as the receiver requested

    @property
    def delivered(self) -> bool:
        """Whether the receiver accepted the message."""
        return self.status is not None and self.error is None

    @property
    def gone(self) -> bool:
        """Whether the receiver wants no more messages."""
        return self.status == GONE


NO_ANSWER = Answer(None, "No address was tried.")


@dataclass(slots=True)
class _Heard:
    """The response received so far."""

    answer: Answer = NO_ANSWER
    content: bytearray = field(default_factory=bytearray)


@dataclass(frozen=True)
class Poster:
    """Posts messages to addresses that `policy` allows.

    Certificates are checked against `trust`, by default the usual authorities.
    """

    policy: AddressPolicy
    trust: ssl.SSLContext | None = None
    timeouts: Timeouts = field(default_factory=Timeouts)

    @cached_property
    def _trust(self) -> ssl.SSLContext:
        import httpx  # lazy, here and below: most processes never send webhooks

        # its lines would contain the receivers' addresses, with secrets in their queries
        logging.getLogger("httpx").setLevel(logging.WARNING)
        return self.trust or httpx.create_ssl_context()

    async def post(
        self, url: str, headers: Mapping[str, str], body: bytes, *, challenge: str | None = None
    ) -> Answer:
        """Send one message; every failure is returned, never raised.

        A message with a `challenge` is delivered only to a receiver that answers ``{"challenge": "..."}``.
        """
        import httpx

        heard = _Heard()
        try:
            async with asyncio.timeout(self.timeouts.total_s):
                await self._exchange(await self.policy.target(url), headers, body, heard)
        except (AddressRefused, OSError, ValueError, httpx.HTTPError, httpx.InvalidURL) as error:
            if heard.answer is NO_ANSWER:
                return Answer(None, _why(error))
        # also for a receiver that sent its status and then trickled or broke off
        if challenge is not None and heard.answer.delivered and not _echoes(heard.content, challenge):
            return replace(heard.answer, error=NOT_ECHOED)
        return heard.answer

    async def _exchange(self, target: Target, headers: Mapping[str, str], body: bytes, heard: _Heard) -> None:
        """Send to the first of the checked addresses that accepts a connection."""
        import httpx

        url = httpx.URL(target.url)
        client = httpx.AsyncClient(  # for this message only: the next one is resolved and checked again
            verify=self._trust,
            trust_env=False,  # a proxy would connect to an unchecked address
            follow_redirects=False,
            timeout=httpx.Timeout(self.timeouts.read_s, connect=self.timeouts.connect_s),
            headers={
                "host": url.netloc.decode("ascii"),
                "content-type": "application/json",
                "user-agent": f"MorphID/{VERSION}",
                "accept-encoding": "identity",
                **headers,
            },
        )
        sni = {"sni_hostname": target.host}  # the certificate is the name's, not the address's
        async with client:
            *others, last = target.addresses[:MAX_ADDRESSES]
            for address in others:
                with contextlib.suppress(httpx.ConnectError, httpx.ConnectTimeout):
                    return await _hear(client, url.copy_with(host=address), body, sni, heard)
            return await _hear(client, url.copy_with(host=last), body, sni, heard)


async def _hear(
    client: httpx.AsyncClient, url: httpx.URL, body: bytes, extensions: dict[str, str], heard: _Heard
) -> None:
    async with client.stream("POST", url, content=body, extensions=extensions) as response:
        status = response.status_code
        retry_after_s = parse_retry_after(response.headers.get("retry-after"), time.time())
        error = None if 200 <= status < 300 else f"The receiver answered {status}."
        heard.answer = Answer(status, error, retry_after_s)
        async for piece in response.aiter_raw():
            heard.content += piece
            if len(heard.content) > MAX_ANSWER_BYTES:
                break


def _echoes(content: bytearray, challenge: str) -> bool:
    """Whether an answer is a JSON object with the challenge in it."""
    try:
        answer = json.loads(content)
    except (ValueError, RecursionError):
        return False
    return isinstance(answer, dict) and answer.get("challenge") == challenge


def _why(failure: Exception) -> str:
    """Explain why there was no response, without quoting the receiver."""
    import httpx

    if isinstance(failure, AddressRefused):
        return f"Refused: {failure}"
    chain: BaseException | None = failure if isinstance(failure, httpx.ConnectError) else None
    while chain is not None:
        if isinstance(chain, ssl.SSLCertVerificationError):
            return "The receiver's certificate is not valid for its name."
        chain = chain.__cause__ or chain.__context__
    sentences: tuple[tuple[tuple[type[Exception], ...], str], ...] = (
        ((TimeoutError, httpx.TimeoutException), "There was no answer in time."),
        ((httpx.ConnectError,), "No (secure) connection could be made."),
        ((httpx.HTTPError,), "The connection broke."),
        ((OSError,), "The name is not known."),
    )
    return next(
        (words for kinds, words in sentences if isinstance(failure, kinds)), "The URL cannot be used."
    )
