"""The text of a key: ``mid_<prefix>_<secret>``.

The secret is 256 random bits and cannot be guessed, so a plain SHA-256 of it is sufficient. Slow hashes are
for passwords chosen by people; here one would only cost a tenth of a second per request.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
from dataclasses import dataclass
from typing import Self

from app.identifiers import base32

PREFIX_BITS, PREFIX_CHARACTERS = 40, 8
SECRET_BITS, SECRET_CHARACTERS = 256, 52
# the fixed beginning lets scanners of repositories and logs find leaked keys
FORM = re.compile(rf"mid_([0-9a-z]{{{PREFIX_CHARACTERS}}})_([0-9a-z]{{{SECRET_CHARACTERS}}})")


@dataclass(frozen=True, slots=True, repr=False)
class KeyText:
    """The full text of a key; only `prefix` may be shown or logged."""

    prefix: str  # finds the row
    secret: str  # proves possession of the key

    @classmethod
    def new(cls) -> Self:
        """Make a new key of the system's randomness."""
        return cls(
            base32(secrets.randbits(PREFIX_BITS), PREFIX_CHARACTERS),
            base32(secrets.randbits(SECRET_BITS), SECRET_CHARACTERS),
        )

    @classmethod
    def parsed(cls, text: str) -> Self | None:
        """Parse a key; None if it does not have the form of one."""
        match = FORM.fullmatch(text)
        return None if match is None else cls(match[1], match[2])

    def text(self) -> str:
        """The whole key, to be shown once."""
        return f"mid_{self.prefix}_{self.secret}"

    def digest(self) -> str:
        """The stored digest of the secret."""
        return hashlib.sha256(self.secret.encode()).hexdigest()

    def matches(self, digest: str) -> bool:
        """Whether `digest` belongs to this secret, compared in constant time."""
        return hmac.compare_digest(self.digest(), digest)

    def __repr__(self) -> str:
        return f"KeyText(prefix={self.prefix!r})"
