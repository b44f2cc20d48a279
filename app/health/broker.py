"""Health of the broker: the reply to a PING with our password, since an open port alone proves little."""

from __future__ import annotations

from functools import lru_cache
from ssl import SSLCertVerificationError
from typing import Any

from app.broker import canonical, is_redis

BROKER_TIMEOUT_S = 0.5
NOT_CHECKED = "not checked (no Redis)"
UNREACHABLE = "unreachable"
NOT_TRUSTED = "shows a certificate that is not trusted"
BROKER_GOOD = frozenset({"ok", NOT_CHECKED})


@lru_cache(maxsize=4)
def broker_client(url: str) -> Any:
    """Return a client that tries once and does not wait long."""
    from redis import Redis  # lazy: half a second of imports
    from redis.backoff import NoBackoff
    from redis.retry import Retry

    return Redis.from_url(
        canonical(url),
        socket_connect_timeout=BROKER_TIMEOUT_S,
        socket_timeout=BROKER_TIMEOUT_S,
        retry=Retry(NoBackoff(), 0),
        decode_responses=True,
    )


def broker_state(url: str) -> str:
    """``ok`` when the broker answers, or what is wrong."""
    if not is_redis(url):
        return NOT_CHECKED
    from redis import exceptions

    try:
        broker_client(url).ping()
    except exceptions.AuthenticationError:
        return "refuses our password"
    except (exceptions.ConnectionError, exceptions.TimeoutError, OSError) as error:
        return NOT_TRUSTED if isinstance(error.__context__, SSLCertVerificationError) else UNREACHABLE
    except exceptions.RedisError as error:
        return f"answers {str(error)[:80]!r}"  # loading, out of memory: worth reading
    return "ok"
