"""``morphid keys``: make, list and revoke the API keys of a service, on its database."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from morphid.commands import options
from morphid.database import service_database
from morphid.exits import CommandError, Exit
from morphid.screen import new_table, print_json, reports_errors, stderr, stdout

if TYPE_CHECKING:
    from app.keys.records import ApiKey, Scope

keys = typer.Typer(help="Make, list and revoke API keys.", no_args_is_help=True, epilog=options.EXIT_CODES)

QUOTAS = "Quotas"  # heading of a group of options
AFTER = re.compile(r"(\d{1,5})\s*([dh])")
STATE_COLOURS = {"active": "green", "expired": "yellow", "revoked": "red"}
COLUMNS = ("prefix", "owner", "name", "state", "scopes", "last use UTC", "expires UTC")


@keys.command("create")
@reports_errors
def create_key(
    owner: Annotated[
        str, typer.Option(help="Owner of the key; keys of one owner see the same jobs and models.")
    ],
    name: Annotated[str, typer.Option(help="A name to recognise the key.")],
    scope: Annotated[
        list[str] | None,
        typer.Option(help="Scope; repeatable. Default: all but `metrics`; see `morphid keys scopes`."),
    ] = None,
    expires: Annotated[str | None, typer.Option(help="When: `90d`, `12h`, or a date in UTC.")] = None,
    max_jobs: Annotated[
        int | None, typer.Option(min=1, help="Unfinished jobs at a time.", rich_help_panel=QUOTAS)
    ] = None,
    max_flights_per_day: Annotated[
        int | None, typer.Option(min=1, help="Flights a day, UTC.", rich_help_panel=QUOTAS)
    ] = None,
    max_bytes: Annotated[
        int | None, typer.Option(min=1, help="Stored bytes.", rich_help_panel=QUOTAS)
    ] = None,
    data_dir: options.DataDir = None,
    as_json: options.AsJson = False,
) -> None:
    """Create a key and show it once; only a digest is stored."""
    from app.keys import service
    from app.keys.records import Quota

    scopes, quota = _scopes(scope or []), Quota(max_jobs, max_flights_per_day, max_bytes)
    expires_at = None if expires is None else moment_of(expires)
    with service_database(data_dir) as database, _refusals(), database.write() as session:
        made = service.create_key(
            session, owner=owner, name=name, scopes=scopes, quota=quota, expires_at=expires_at
        )
    if as_json:
        print_json({"key": made.text, **_document(made.key)})
        return
    stdout().print(made.text, markup=False, soft_wrap=True)
    stderr().print(
        f"This is shown once. Use it as `Authorization: Bearer ...` or MORPHID_API_KEY; "
        f"`morphid keys revoke {made.key.prefix}` ends it.",
        markup=False,
    )


@keys.command("ls")
@reports_errors
def list_keys(
    owner: Annotated[str | None, typer.Option(help="Only keys of this owner.")] = None,
    data_dir: options.DataDir = None,
    as_json: options.AsJson = False,
) -> None:
    """List the keys with owner, name, scopes and last use, without their secrets."""
    from app.keys import repository

    with service_database(data_dir) as database, database.read() as session:
        found = repository.list_keys(session, owner=owner)
    if as_json:
        print_json([_document(key) for key in found])
    else:
        stdout().print(_table(found))


@keys.command("revoke")
@reports_errors
def revoke_key(
    key: Annotated[str, typer.Argument(metavar="KEY", help="Its prefix or its id.")],
    data_dir: options.DataDir = None,
    as_json: options.AsJson = False,
) -> None:
    """Revoke a key; running services refuse it within two seconds."""
    from app.keys import service

    with service_database(data_dir) as database, _refusals(), database.write() as session:
        revoked = service.revoke_key(session, key)
    if as_json:
        print_json(_document(revoked))
    else:
        stdout().print(_table([revoked]))


@keys.command("scopes")
def list_scopes(as_json: options.AsJson = False) -> None:
    """List the scopes that a key can have."""
    from app.keys.records import SCOPE_MEANINGS

    if as_json:
        print_json({scope.value: meaning for scope, meaning in SCOPE_MEANINGS.items()})
        return
    for scope, meaning in SCOPE_MEANINGS.items():
        stdout().print(f"{scope.value:<12} {meaning}", markup=False)


@contextmanager
def _refusals() -> Iterator[None]:
    from app.keys.service import KeyRefused

    try:
        yield
    except KeyRefused as error:
        raise CommandError(str(error), code=Exit.INVALID_INPUT, hint="see `morphid keys ls`") from None


def _scopes(names: Sequence[str]) -> list[Scope]:
    """Convert names to scopes; without names, the usual ones."""
    from app.keys.records import USUAL_SCOPES, Scope

    known = {scope.value: scope for scope in Scope}
    unknown = [name for name in names if name not in known]
    if unknown:
        raise CommandError(
            f"there is no scope {unknown[0]!r}", code=Exit.USAGE, hint=f"one of {', '.join(sorted(known))}"
        )
    return sorted({known[name] for name in names} or USUAL_SCOPES)


def moment_of(text: str) -> float:
    """Parse ``90d``, ``12h`` or a future date (UTC unless stated otherwise) to s since 1970 UTC."""
    now = datetime.now(UTC)
    after = AFTER.fullmatch(text.strip())
    try:
        if after is not None:
            unit = timedelta(days=1) if after[2] == "d" else timedelta(hours=1)
            moment = now + int(after[1]) * unit
        else:
            moment = datetime.fromisoformat(text.strip())
            moment = moment if moment.tzinfo is not None else moment.replace(tzinfo=UTC)
    except (ValueError, OverflowError):
        raise CommandError(
            f"{text!r} is no time", code=Exit.USAGE, hint="write `90d`, `12h` or `2027-01-31`"
        ) from None
    if moment <= now:
        raise CommandError(f"{text!r} has passed", code=Exit.USAGE, hint="a key needs a future")
    return moment.timestamp()


def _document(key: ApiKey) -> dict[str, Any]:
    """Return a key as JSON, without its secret, which is not stored."""
    moments = ("created_at", "expires_at", "revoked_at", "last_used_at")
    return {
        **{name: getattr(key, name) for name in ("id", "owner", "name", "prefix", "state")},
        "scopes": sorted(key.scopes),
        "max_jobs_in_flight": key.quota.max_jobs_in_flight,
        "max_flights_per_day": key.quota.max_flights_per_day,
        "max_stored_bytes": key.quota.max_stored_bytes,
        **{
            name: None if (moment := getattr(key, name)) is None else moment.isoformat(timespec="seconds")
            for name in moments
        },
    }


def _table(found: Sequence[ApiKey]) -> Table:
    from app.keys.records import EVERY_SCOPE, USUAL_SCOPES

    shown_scopes = {EVERY_SCOPE: "all", USUAL_SCOPES: "all but metrics"}
    table = new_table(*COLUMNS, left=len(COLUMNS), wrapped=("scopes",))
    for key in found:
        table.add_row(
            key.prefix,
            key.owner,
            escape(key.name),
            f"[{STATE_COLOURS[key.state]}]{key.state}[/]",
            shown_scopes.get(key.scopes) or " ".join(sorted(key.scopes)),
            *(f"{at:%y-%m-%d %H:%M}" if at else "never" for at in (key.last_used_at, key.expires_at)),
        )
    return table
