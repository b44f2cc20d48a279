"""Shared by clients of unencrypted services: httpx reads all certificates for each client, in 30 ms."""

from __future__ import annotations

import ssl

CERTIFICATES = ssl.create_default_context()  # as each client would read them
