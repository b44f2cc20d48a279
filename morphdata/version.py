"""Version of the installed package; pyproject.toml says it once."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

try:
    VERSION = version("morphid")
except PackageNotFoundError:  # run from a source tree that is not installed
    VERSION = "0+unknown"
