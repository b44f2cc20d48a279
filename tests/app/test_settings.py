"""Laws of the settings: unsafe combinations are refused in words."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.settings import UnsafeSettings, is_loopback, load_settings

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
        ({"host": EVERYWHERE}, "MORPHID_ALLOW_OPEN"),
        ({"host": "192.168.1.5"}, "MORPHID_ALLOW_OPEN"),
        ({"host": "example.org"}, "MORPHID_ALLOW_OPEN"),
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


def test_open_service_must_be_asked_for() -> None:
    """Listening beyond this machine works when it is allowed by name."""
    assert load_settings(host=EVERYWHERE, allow_open=True).host == EVERYWHERE


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.9.1", "::1", "[::1]", "localhost"])
def test_loopback_is_known(host: str) -> None:
    """Every way to name this machine only."""
    assert is_loopback(host)
