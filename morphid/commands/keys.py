"""``morphid keys``: make, list and revoke the API keys of a service, on its database."""

from __future__ import annotations

from typing import Annotated

import typer

from morphid.commands import options
from morphid.screen import print_json, reports_errors, stderr, stdout

keys = typer.Typer(help="Make, list and revoke API keys.", no_args_is_help=True, epilog=options.EXIT_CODES)

quota_option = "Quotas"


@keys.command("create")
@reports_errors
def create_key(
    owner: Annotated[str, typer.Option(help="Whose key: keys of one owner see the same jobs and models.")],
    name: Annotated[str, typer.Option(help="A name to recognise it by.")],
    scope: Annotated[
        list[str] | None,
        typer.Option(
            help="Scope; may be repeated. All but `metrics` when left out: see `morphid keys scopes`."
        ),
    ] = None,
    expires: Annotated[str | None, typer.Option(help="When: `90d`, `12h`, or a date in UTC.")] = None,
    max_jobs: Annotated[
        int | None, typer.Option(min=1, help="Unfinished jobs at a time.", rich_help_panel=quota_option)
    ] = None,
    max_flights_per_day: Annotated[
        int | None, typer.Option(min=1, help="Flights a day, UTC.", rich_help_panel=quota_option)
    ] = None,
    max_bytes: Annotated[
        int | None, typer.Option(min=1, help="Stored bytes.", rich_help_panel=quota_option)
    ] = None,
    data_dir: options.DataDir = None,
    as_json: options.AsJson = False,
) -> None:
    """Create a key and show it once; only a digest is stored."""
    from app.keys.records import Quota
    from morphid import keys as work

    made = work.create(
        data_dir,
        owner=owner,
        name=name,
        scopes=work.scopes_of(scope or []),
        quota=Quota(max_jobs, max_flights_per_day, max_bytes),
        expires_at=None if expires is None else work.moment_of(expires),
    )
    if as_json:
        print_json({"key": made.text, **work.document(made.key)})
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
    """List the keys: whose, what for, what they may do, when they were used; never their secrets."""
    from morphid import keys as work

    found = work.listed(data_dir, owner)
    if as_json:
        print_json([work.document(key) for key in found])
    else:
        stdout().print(work.table(found))


@keys.command("revoke")
@reports_errors
def revoke_key(
    key: Annotated[str, typer.Argument(metavar="KEY", help="Its prefix or its id.")],
    data_dir: options.DataDir = None,
    as_json: options.AsJson = False,
) -> None:
    """Revoke a key; running services refuse it two seconds later."""
    from morphid import keys as work

    revoked = work.revoke(data_dir, key)
    if as_json:
        print_json(work.document(revoked))
    else:
        stdout().print(work.table([revoked]))


@keys.command("scopes")
def list_scopes(as_json: options.AsJson = False) -> None:
    """List what a key may be allowed to do."""
    from app.keys.records import SCOPE_MEANINGS

    if as_json:
        print_json({scope.value: meaning for scope, meaning in SCOPE_MEANINGS.items()})
        return
    for scope, meaning in SCOPE_MEANINGS.items():
        stdout().print(f"{scope.value:<12} {meaning}", markup=False)
