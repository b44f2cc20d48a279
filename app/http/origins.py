"""Who may send a request at all: no page of another site, nobody by a name that is not ours.

A service on loopback is open to every program of its user, and a browser is one: any web page could have it
post jobs (cross-site requests), or read answers after its own name has been pointed at 127.0.0.1 (DNS
rebinding). Browsers state where a request comes from (``Sec-Fetch-Site``, ``Origin``) and by which name
(``Host``); pages cannot forge these. Programs that are not browsers send none or any, and are let through.
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
    """What is let in from outside.

    Attributes
    ----------
    hosts : frozenset of str or None
        Names that the service answers for, in addition to addresses and loopback names; None: any name.
    loopback_only : bool
        Refuse whatever came over a network, even if the server listens there.
    """

    hosts: frozenset[str] | None
    loopback_only: bool

    @classmethod
    def of(cls, settings: Settings) -> Boundary:
        """The boundary that the settings draw.

        With keys a foreign page gains nothing by a name of its own: it has no key. So names are then
        restricted only on request.
        """
        named = settings.host_names
        if settings.demands_keys:
            return cls(hosts=named or None, loopback_only=False)
        return cls(hosts=named | {settings.host.lower()}, loopback_only=not settings.allow_open)


def refusal(scope: Scope, boundary: Boundary) -> ServiceError | None:
    """Return why a request is refused unseen; None when it may pass."""
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
    # a Unix socket has no address; a proxy on this machine that forwards the client's address is seen through
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
    return True  # nobody can point an address elsewhere


def _from_another_site(scope: Scope, headers: Headers) -> bool:
    site = headers.get("sec-fetch-site")
    if site is not None:
        return site not in OWN_SITES and not _is_navigation(scope, headers)
    origin = headers.get("origin")
    return origin is not None and urlsplit(origin).netloc.lower() != headers.get("host", "").lower()


def _is_navigation(scope: Scope, headers: Headers) -> bool:
    """Whether someone followed a link to here: the answer is shown to them, not to the page with the link."""
    return (
        scope["method"] in ("GET", "HEAD")
        and headers.get("sec-fetch-mode") == "navigate"
        and headers.get("sec-fetch-dest") == "document"
    )
