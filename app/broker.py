"""The broker's address, normalised to one spelling that all our clients interpret alike.

Celery's own parser and redis-py's differ: in Celery a bare ``rediss://`` does not check certificates, and the
two use different names for the same options. So an address is written once in redis-py's spelling, with
defaults filled in, and both the health check and Celery's transport (`app.jobs.transport`) pass it to
redis-py.
"""

from __future__ import annotations

from urllib.parse import parse_qsl, quote, urlencode, urlsplit

SCHEMES = {
    "redis": "redis",
    "rediss": "rediss",
    "valkey": "redis",
    "valkeys": "rediss",
    "unix": "unix",
    "redis+socket": "unix",  # Celery's
}
CERTIFICATE_CHECKS = ("required", "optional", "none")  # in Celery's spelling with `cert_` before them
OPTIONS = frozenset({"client_name", "db", "password", "protocol", "username"})
HOST_OPTIONS = frozenset({"socket_keepalive"})  # not applicable to a socket file
TLS_OPTIONS = frozenset(
    f"ssl_{name}"
    for name in (
        *("ca_certs", "ca_path", "cert_reqs", "certfile", "check_hostname"),
        *("ciphers", "keyfile", "min_version", "password"),
    )
)
OPTIONS_OF = {
    "redis": OPTIONS | HOST_OPTIONS,
    "rediss": OPTIONS | HOST_OPTIONS | TLS_OPTIONS,
    "unix": OPTIONS,
}


def is_redis(url: str) -> bool:
    """Whether an address names a Redis or Valkey server."""
    return url.partition("://")[0].lower() in SCHEMES


def canonical(url: str) -> str:
    """Write an address in the spelling of redis-py, with the certificate check made explicit.

    An address of another kind of broker is returned as it is.

    Raises
    ------
    ValueError
        The message is for the operator and does not contain the password.

    Examples
    --------
    >>> canonical("rediss://queue.example")
    'rediss://queue.example?ssl_cert_reqs=required'
    >>> canonical("redis+socket:///run/valkey.sock?virtual_host=2")
    'unix:///run/valkey.sock?db=2'
    """
    if not is_redis(url):
        return url
    parts = urlsplit(url)
    scheme = SCHEMES[parts.scheme]
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    if "virtual_host" in options:
        options["db"] = options.pop("virtual_host").strip("/")
    _refuse_unknown(scheme, options)
    path = parts.path
    number = "" if scheme == "unix" else options.get("db", path.strip("/"))
    if scheme == "unix" and (parts.hostname or not path.strip("/")):
        raise ValueError("MORPHID_BROKER_URL: give the full path of a socket file: unix:///run/valkey.sock")
    if number and not number.isdecimal():
        raise ValueError(
            "MORPHID_BROKER_URL: the part after the broker's host is not a database number; "
            "write a slash in the password as %2F"
        )
    if scheme == "rediss":
        options["ssl_cert_reqs"] = _certificate_check(options.get("ssl_cert_reqs", "required"))
    # Celery treats the part after a semicolon as another address
    place, path = (quote(text, safe="%/:@[]!$&'()*+,=~") for text in (parts.netloc, path))
    return f"{scheme}://{place}{path}" + (f"?{urlencode(options)}" if options else "")


def _refuse_unknown(scheme: str, options: dict[str, str]) -> None:
    known = OPTIONS_OF[scheme]
    for name in sorted(options.keys() - known):
        if name in TLS_OPTIONS:
            raise ValueError(f"MORPHID_BROKER_URL: {name} is for TLS, which is spelled rediss://")
        raise ValueError(
            f"MORPHID_BROKER_URL: unknown option {name[:40]!r}; the options are {', '.join(sorted(known))}"
        )


def _certificate_check(value: str) -> str:
    check = value.lower().removeprefix("cert_")
    if check not in CERTIFICATE_CHECKS:
        raise ValueError(
            f"MORPHID_BROKER_URL: ssl_cert_reqs is required, optional or none, not {value[:40]!r}"
        )
    return check
