"""Secrets and signatures by Standard Webhooks (https://www.standardwebhooks.com)."""

from __future__ import annotations

import base64
import secrets
from datetime import UTC, datetime

from standardwebhooks import Webhook

SECRET_BYTES = 32  # the standard requires 24 to 64


def new_secret() -> str:
    """Make a secret in the form that the standard's libraries take."""
    return "whsec_" + base64.b64encode(secrets.token_bytes(SECRET_BYTES)).decode()


def signed_headers(secret: str, message_id: str, timestamp: float, body: bytes) -> dict[str, str]:
    """Headers by which the receiver knows sender, message and time.

    The message's id is the same in every try, so that the receiver can skip what it has seen; the timestamp
    (s since 1970 UTC) is that of the try.
    """
    moment = datetime.fromtimestamp(int(timestamp), UTC)
    return {
        "webhook-id": message_id,
        "webhook-timestamp": str(int(timestamp)),
        "webhook-signature": Webhook(secret).sign(message_id, moment, body.decode()),
    }
