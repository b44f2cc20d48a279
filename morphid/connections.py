"""Connections of the command to a service: address, key and proxy."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit
from urllib.request import proxy_bypass

from morphid.exits import CommandError, Exit

if TYPE_CHECKING:
    import httpx

DEFAULT_URL = "http://127.0.0.1:8000"
URL_VARIABLE, KEY_VARIABLE = "MORPHID_URL", "MORPHID_API_KEY"
EVERY_ADDRESS = frozenset({"0.0.0.0", "::"})  # noqa: S104 - a client that dials it reaches its own machine


def at_service_of_environment(url: str | None) -> bool:
    """Whether the service is selected by MORPHID_URL."""
    return url is not None and url == os.environ.get(URL_VARIABLE)


def client_for(url: str, *, direct: bool = False, **options: Any) -> httpx.Client:
    """Open a client for one service: through the environment's proxy, but never to this machine.

    The loopback of a proxy is another machine's: a service running here would seem to be down, and the proxy
    would receive its key.

    Parameters
    ----------
    direct : the service is known to be on this machine, whatever its address.
    options : of `httpx.Client`.
    """
    import httpx

    try:
        parts = urlsplit(url)
        host = parts.hostname or ""
        _ = parts.port  # parsed here because it may be invalid
        httpx.URL(url)
    except (ValueError, httpx.InvalidURL) as error:
        raise CommandError(
            f"{url} is not the address of a service: {error}", code=Exit.USAGE, hint=f"write {DEFAULT_URL}"
        ) from None
    if options.get("transport") is None and (direct or _reached_directly(host)):
        options["transport"] = httpx.HTTPTransport()  # explicit, so that the client does not look for proxies
    try:
        return httpx.Client(base_url=url, **options)
    except (ImportError, ValueError, httpx.InvalidURL) as error:
        # SOCKS without its package, a proxy of an unknown kind, or no address of one
        raise CommandError(
            f"the proxy that the environment names for {url} cannot be used: {error}",
            code=Exit.ENVIRONMENT,
            hint="pip install 'httpx[socks]' for a SOCKS proxy; correct ALL_PROXY, HTTPS_PROXY, HTTP_PROXY; "
            "or name the service's host in NO_PROXY",
        ) from None


def _reached_directly(host: str) -> bool:
    from app.loopback import is_loopback

    return is_loopback(host) or host in EVERY_ADDRESS or bool(proxy_bypass(host))
