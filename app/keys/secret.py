"""The text of a key: ``mid_<prefix>_<secret>``.

The secret is 256 random bits, so nobody finds it by trying: a plain SHA-256 of it is enough. Slow hashes are
for passwords, which people choose; here one would only cost every request a tenth of a second.
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
# the first letters let scanners of repositories and logs find keys that leaked
FORM = re.compile(rf"mid_([0-9a-z]{{{PREFIX_CHARACTERS}}})_([0-9a-z]{{{SECRET_CHARACTERS}}})")


@dataclass(frozen=True, slots=True, repr=False)
class KeyText:
    """A key as its user holds it; only `prefix` may be shown or logged."""

    prefix: str  # finds the row
    secret: str  # proves that the key is held

    @classmethod
    def new(cls) -> Self:
        """Make a new key of the system's randomness."""
        return cls(
            base32(secrets.randbits(PREFIX_BITS), PREFIX_CHARACTERS),
            base32(secrets.randbits(SECRET_BITS), SECRET_CHARACTERS),
        )

    @classmethod
    def parsed(cls, text: str) -> Self | None:
        """Take a key apart; None when it has not the form of one."""
        match = FORM.fullmatch(text)
        return None if match is None else cls(match[1], match[2])

    def text(self) -> str:
        """The whole key, to be shown once."""
        return f"mid_{self.prefix}_{self.secret}"

    def digest(self) -> str:
        """What is stored of the secret."""
        return hashlib.sha256(self.secret.encode()).hexdigest()

    def matches(self, digest: str) -> bool:
        """Whether `digest` is this secret's; takes the same time wherever they differ."""
        return hmac.compare_digest(self.digest(), digest)

    def __repr__(self) -> str:
        return f"KeyText(prefix={self.prefix!r})"
