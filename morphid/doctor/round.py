"""The checks of the doctor, in order."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from morphid.doctor import machine, remote, service
from morphid.doctor.findings import Check, Finding, examined, fail, ok


def round_here(data_dir: Path | None) -> Iterator[Finding]:
    """Examine this installation, and the service that the settings describe."""
    from morphid.configured import settings_for
    from morphid.exits import CommandError

    checks: list[tuple[str, Check]] = [
        ("python", machine.python),
        ("packages", machine.packages),
        ("compiler", machine.compiler),
        ("open files", machine.files),
    ]
    yield from examined(checks)
    try:
        settings = settings_for(data_dir=data_dir)
    except CommandError as error:
        yield fail("settings", error.message, "correct the MORPHID_ variables; docs/service.md lists them")
        return
    yield from examined(
        [
            ("data directory", partial(machine.data_dir, settings.data_dir, sqlite=settings.uses_sqlite)),
            ("cores", partial(machine.cores, settings.workers)),
            ("settings", partial(service.unsafe, settings)),
            ("database", partial(service.database, settings)),
            (
                "broker",
                partial(service.broker, settings.broker_url) if settings.names_broker else _own_broker,
            ),
            ("jobs", partial(service.work, settings)),
            ("keys", partial(service.keys, settings)),
            ("port", partial(service.port, settings.host, settings.port)),
        ]
    )


def _own_broker() -> Iterator[Finding]:
    """`morphid serve` starts its own broker if none is configured; only its processes know the password."""
    from morphid.broker import find_server
    from morphid.exits import CommandError

    try:
        yield ok("broker", f"`morphid serve` runs {find_server()}")
    except CommandError as error:
        yield fail("broker", error.message, error.hint)


def round_there(url: str, api_key: str | None) -> Iterator[Finding]:
    """Examine a service from outside."""
    yield from examined([("service", partial(remote.service, url.rstrip("/"), api_key))])
