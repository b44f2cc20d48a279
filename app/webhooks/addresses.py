"""Permitted webhook addresses: this machine and its networks are never contacted.

A name is resolved once per try and the connection goes to the checked address, so that changing the address
between check and use has no effect.
"""

from __future__ import annotations

import asyncio
import ipaddress
import re
import socket
import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from urllib.parse import SplitResult, urlsplit

from app.loopback import is_loopback

Address = ipaddress.IPv4Address | ipaddress.IPv6Address
Resolver = Callable[[str, int], list[str]]

MAX_URL = 2000
DEFAULT_PORTS = {"https": 443, "http": 80}
LOWEST_PORT = 1024  # lower ports are for mail, SSH and the like; only HTTPS is allowed there
LOOKUP_S = 3.0  # s at creation; the sender has its own limit
MAX_LOOKUPS = 32  # concurrent look-ups; an unresponsive name server must not use up the threads
HOST = re.compile(r"[A-Za-z0-9_](?:[A-Za-z0-9._-]{0,251}[A-Za-z0-9_])?\.?")
# as a last label: a disguised address, 127.1 or 0x7f000001
NUMBER = re.compile(r"(?:\d+|0[xX][0-9A-Fa-f]*)")
NAT64 = ipaddress.ip_network("64:ff9b::/96")
GLOBAL_UNICAST_6 = ipaddress.ip_network("2000::/3")
NEVER = tuple(
    ipaddress.ip_network(block)
    for block in (
        "168.63.129.16/32",  # Azure's metadata and host services, in public space
        "192.0.0.0/24",  # protocol assignments
        "192.88.99.0/24",  # 6to4 relays
        "2001::/23",  # protocol assignments: Teredo, ORCHID
        "3fff::/20",  # documentation
    )
)


class AddressRefused(Exception):
    """Webhooks are not sent to this address; the message says why."""

    hint = "Give an https address that can be reached from the public internet."


class HostNotListed(AddressRefused):
    """The host is not on the operator's list of webhook hosts."""

    hint = "Ask the operator to add the host to MORPHID_WEBHOOK_DIAL_ONLY."


def is_public(address: Address) -> bool:
    """Whether `address` is global unicast, and so is any IPv4 address that is wrapped in it."""
    if isinstance(address, ipaddress.IPv6Address):
        if address.scope_id is not None:
            return False
        inner = address.ipv4_mapped or address.sixtofour
        if inner is None and address in NAT64:
            inner = ipaddress.IPv4Address(int(address) & 0xFFFFFFFF)
        if inner is not None:
            return is_public(inner)
        if address not in GLOBAL_UNICAST_6:
            return False
    elif address.is_reserved:
        return False
    listed = any(address in block for block in NEVER if block.version == address.version)
    return address.is_global and not address.is_multicast and not listed


def look_up(host: str, port: int) -> list[str]:
    """Return all addresses of `host` from the system's resolver."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    return list(dict.fromkeys(str(entry[4][0]) for entry in found))


_lookups = threading.BoundedSemaphore(MAX_LOOKUPS)


def destination_of(url: str) -> str:
    """Scheme, host and port of a checked URL, which determine reachability, whatever the path."""
    parts = urlsplit(url)
    return f"{parts.scheme}://{(parts.hostname or '').rstrip('.')}:{_port(parts)}"


def _port(parts: SplitResult) -> int:
    return DEFAULT_PORTS.get(parts.scheme, 0) if parts.port is None else parts.port


@dataclass(frozen=True, slots=True)
class Target:
    """A URL whose host may be connected to."""

    url: str
    host: str
    addresses: tuple[str, ...]  # of the host, all checked


@dataclass(frozen=True, slots=True)
class AddressPolicy:
    """Rules for webhook addresses.

    Parameters
    ----------
    allow_private : bool
        For development on one machine: loopback and private networks too, and ``http`` to loopback.
    resolve : callable
        ``(host, port) -> addresses``; raises OSError for a name that is not known.
    dial_only : frozenset of str
        ``host`` or ``host:port``, as written in URLs; no other host is contacted. Empty: any.
    """

    allow_private: bool = False
    resolve: Resolver = look_up
    dial_only: frozenset[str] = frozenset()

    def check_url(self, url: str) -> SplitResult:
        """Check everything that does not need name resolution."""
        if len(url) > MAX_URL or not url.isascii() or re.search(r"[\x00-\x20\x7f\\]", url):
            raise AddressRefused(f"A URL has at most {MAX_URL} characters, all ASCII, without spaces.")
        try:
            parts = urlsplit(url)
            port = _port(parts)
        except ValueError:
            raise AddressRefused("The URL cannot be read.") from None
        host = parts.hostname or ""
        plain_allowed = self.allow_private and is_loopback(host)
        if parts.scheme != "https" and not (parts.scheme == "http" and plain_allowed):
            raise AddressRefused("The URL must begin with https://.")
        if "@" in parts.netloc:
            raise AddressRefused("The URL must not hold a user name or password.")
        if parts.fragment:
            raise AddressRefused("The URL must not have a fragment (#...).")
        if port < LOWEST_PORT and port != DEFAULT_PORTS[parts.scheme]:
            raise AddressRefused(f"The port must be 443, or {LOWEST_PORT} and above.")
        self._check_host(host)
        name = f"[{host}]" if ":" in host else host
        if self.dial_only and not self.dial_only & {name, f"{name}:{port}"}:
            raise HostNotListed(
                "This service sends webhooks only to certain hosts, and this is not one of them."
            )
        return parts

    def _check_host(self, host: str) -> None:
        try:
            address = ipaddress.ip_address(host)
        except ValueError:
            last_label = host.rstrip(".").rpartition(".")[2]
            if not HOST.fullmatch(host) or NUMBER.fullmatch(last_label):
                raise AddressRefused("The host is not a name or an address.") from None
        else:
            self._check_address(str(address))

    def _check_address(self, text: str) -> None:
        try:
            address = ipaddress.ip_address(text)
        except ValueError:
            raise AddressRefused("The name has no readable address.") from None
        if is_public(address):
            return
        # link-local stays out even here: cloud machines keep their credentials there
        near = address.is_loopback or (address.is_private and not address.is_link_local)
        special = address.is_unspecified or address.is_multicast or address.is_reserved
        if not (self.allow_private and near and not special):
            raise AddressRefused("The address is not a public one.")

    def _checked(self, parts: SplitResult, addresses: list[str]) -> Target:
        if not addresses:
            raise AddressRefused("The name has no address.")
        for address in addresses:
            self._check_address(address)
            if parts.scheme != "https" and not is_loopback(address):
                raise AddressRefused("Plain http is for this machine only.")
        return Target(parts.geturl(), (parts.hostname or "").rstrip("."), tuple(addresses))

    def check_now(self, url: str) -> None:
        """Check a URL with its present addresses; a name that cannot be resolved yet passes."""
        parts = self.check_url(url)
        try:
            found = self._look_up(parts).result(LOOKUP_S)
        except OSError:  # also raised on a timeout
            return  # the first try will show it in the webhook's deliveries
        self._checked(parts, found)

    async def target(self, url: str) -> Target:
        """Resolve the name, once, and return the target of the connection.

        Raises
        ------
        AddressRefused
            Not all of its addresses are allowed.
        OSError
            The name is not known.
        """
        parts = self.check_url(url)
        return self._checked(parts, await asyncio.wrap_future(self._look_up(parts)))

    def _look_up(self, parts: SplitResult) -> Future[list[str]]:
        """Resolve in a daemon thread that is never joined: the system's resolver has no time limit."""
        future: Future[list[str]] = Future()
        if not _lookups.acquire(blocking=False):
            future.set_exception(OSError("too many names are being looked up"))
            return future

        def run() -> None:
            try:
                found: list[str] | OSError = self.resolve(parts.hostname or "", _port(parts))
            except (OSError, UnicodeError) as error:
                found = OSError(str(error))
            finally:
                _lookups.release()
            if not future.set_running_or_notify_cancel():
                return  # the caller has given up
            if isinstance(found, OSError):
                future.set_exception(found)
            else:
                future.set_result(found)

        threading.Thread(target=run, name="webhook-lookup", daemon=True).start()
        return future
