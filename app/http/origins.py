"""Checks of origin and host: no requests from pages of other sites or to host names that are not ours.

A service on loopback is open to every program of its user, including browsers: any web page could make a
browser post jobs (cross-site requests), or read responses after pointing its own name at 127.0.0.1 (DNS
rebinding). Browsers state the origin of a request (``Sec-Fetch-Site``, ``Origin``) and the host name used
(``Host``); pages cannot forge these. Other programs may omit or set them freely, and are let through.
"""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.types import Scope

from app.errors import CrossSiteRequest, ServiceError, WrongHost
from app.loopback import is_loopback
from app.settings import Settings

OWN_SITES = frozenset({"same-origin", "none"})  # none: typed, or a bookmark


@dataclass(frozen=True, slots=True)
class Boundary:
    """Rules for requests from outside.

    Attributes
    ----------
    hosts : frozenset of str or None
        Accepted host names, in addition to addresses and loopback names; None: any name.
    loopback_only : bool
        Refuse all requests from a network, even if the server listens there.
    """

    hosts: frozenset[str] | None
    loopback_only: bool

    @classmethod
    def of(cls, settings: Settings) -> Boundary:
        """Build the rules from the settings.

        If keys are required, a foreign page gains nothing from DNS rebinding because it has no key. So names
        are then restricted only on request.
        """
        named = settings.host_names
        if settings.demands_keys:
            return cls(hosts=named or None, loopback_only=False)
        return cls(hosts=named | {settings.host.lower()}, loopback_only=not settings.allow_open)


def refusal(scope: Scope, boundary: Boundary) -> ServiceError | None:
    """Return why a request is refused; None if it may pass."""
    headers = Headers(scope=scope)
    if boundary.loopback_only and not _came_over_loopback(scope):
        return WrongHost(
            "The service was started for its own machine only.",
            hint="Set MORPHID_HOST to the address that it listens on; API keys are then required.",
        )
    if boundary.hosts is not None and not _answers_for(headers.get("host", ""), boundary.hosts):
        return WrongHost(
            "The Host header is not a name of this service.",
            "#header/Host",
            "Use its address, or add the name to MORPHID_ALLOWED_HOSTS.",
        )
    return CrossSiteRequest() if _from_another_site(scope, headers) else None


def _came_over_loopback(scope: Scope) -> bool:
    # a Unix socket has no address; behind a local proxy the forwarded client address counts
    return all(
        end is None or end[1] is None or not end[0] or is_loopback(end[0])
        for end in (scope.get("server"), scope.get("client"))
    )


def _answers_for(host: str, names: frozenset[str]) -> bool:
    try:
        parts = urlsplit(f"//{host}")
        _ = parts.port  # must be a number
    except ValueError:
        return False
    name = parts.hostname
    if name is None or parts.username is not None or parts.path or parts.query or parts.fragment:
        return False
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return name in names or is_loopback(name) or name.endswith(".localhost")
    return True  # an address, unlike a name, cannot be redirected


def _from_another_site(scope: Scope, headers: Headers) -> bool:
    site = headers.get("sec-fetch-site")
    if site is not None:
        return site not in OWN_SITES and not _is_navigation(scope, headers)
    origin = headers.get("origin")
    return origin is not None and urlsplit(origin).netloc.lower() != headers.get("host", "").lower()


def _is_navigation(scope: Scope, headers: Headers) -> bool:
    """Whether the user followed a link: the response goes to the user, not to the linking page."""
    return (
        scope["method"] in ("GET", "HEAD")
        and headers.get("sec-fetch-mode") == "navigate"
        and headers.get("sec-fetch-dest") == "document"
    )
