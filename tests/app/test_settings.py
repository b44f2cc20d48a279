"""Laws of the settings: unsafe combinations are refused in words."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.loopback import is_loopback
from app.settings import UnsafeSettings, load_settings

EVERYWHERE = "0.0.0.0"  # noqa: S104 - what the tests are about


def test_defaults_serve_one_machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Without any setting the service keeps to this machine, with a file in the data folder."""
    for name in ("MORPHID_DATABASE_URL", "MORPHID_HOST"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("MORPHID_DATA_DIR", str(tmp_path))
    settings = load_settings()
    assert is_loopback(settings.host)
    assert settings.database_url == f"sqlite:///{tmp_path}/morphid.sqlite3"


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"host": EVERYWHERE, "auth": "off"}, "MORPHID_ALLOW_OPEN"),
        ({"host": "192.168.1.5", "auth": "off"}, "MORPHID_ALLOW_OPEN"),
        ({"host": "example.org", "auth": "off"}, "MORPHID_ALLOW_OPEN"),
        ({"auth": "sometimes"}, "MORPHID_AUTH"),
        ({"database_url": "postgresql://morphid:morphid@db/morphid"}, "openssl rand"),
        ({"database_url": "postgresql://me:me@10.0.0.7/x", "auth": "keys"}, "openssl rand"),
        ({"database_url": "postgresql://u:%50assword@db.example/x", "allow_open": True}, "openssl rand"),
        ({"database_url": "sqlite:///x", "broker_url": "redis://queue.example/0"}, "Postgres"),
        ({"heartbeat_s": 40.0}, "MORPHID_LEASE_S"),
        ({"port": 70_000}, "MORPHID_PORT"),
        ({"max_body_bytes": 1}, "MORPHID_MAX_BODY_BYTES"),
    ],
)
def test_unsafe_combinations_are_refused_in_words(overrides: dict[str, object], words: str) -> None:
    """Each refusal names the variable to change."""
    with pytest.raises(UnsafeSettings, match=words):
        load_settings(**overrides)


@pytest.mark.parametrize(
    ("given", "demanded"),
    [
        ({}, False),
        ({"host": "localhost"}, False),
        ({"host": EVERYWHERE}, True),
        ({"host": "192.168.1.5"}, True),
        ({"host": "morphid.example"}, True),
        ({"host": EVERYWHERE, "allow_open": True}, False),
        ({"auth": "keys"}, True),
        ({"auth": "keys", "allow_open": True}, True),
        ({"auth": "off"}, False),
        ({"auth": "off", "host": EVERYWHERE, "allow_open": True}, False),
    ],
)
def test_keys_are_demanded_beyond_this_machine(given: dict[str, object], demanded: bool) -> None:  # noqa: FBT001
    """An open service beyond loopback exists only if explicitly requested."""
    assert load_settings(**given).demands_keys is demanded


@pytest.mark.parametrize(
    "url",
    [
        "postgresql://morphid:morphid@127.0.0.1/morphid",
        "postgresql://morphid@/morphid?host=/run/postgresql",
        "postgresql://morphid@db.example/morphid",
        "postgresql://morphid:5f0d6c0a2a8e@db.example/morphid",
        "sqlite:///morphid.sqlite3",
    ],
)
def test_other_passwords_are_the_operators_business(url: str) -> None:
    """A default password matters where a network leads to the database; none may mean a certificate."""
    assert load_settings(database_url=url).database_url == url


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.9.1", "::1", "[::1]", "localhost"])
def test_loopback_is_known(host: str) -> None:
    """Every way to name this machine only."""
    assert is_loopback(host)
