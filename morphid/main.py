"""The ``morphid`` command. Every command imports what it needs when it runs, so `jobs ls` loads no numba.

Exit codes: 0 done; 1 the job failed; 2 wrong usage; 3 an input is missing or refused; 4 the job was
cancelled or ran out of time (a partial result may be there); 5 no service answers; 6 this machine lacks
a port, a program or a writable directory; 130 Ctrl-C.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from morphid.commands.audit import audit
from morphid.commands.bench import bench
from morphid.commands.database import database
from morphid.commands.doctor import doctor
from morphid.commands.jobs import jobs
from morphid.commands.keys import keys
from morphid.commands.operations import operation_commands
from morphid.commands.options import EXIT_CODES
from morphid.commands.paper import paper
from morphid.commands.ready import ready
from morphid.commands.serve import serve
from morphid.several_values import SeveralValues
from morphid.streams import flush_streams, prepare_streams


class Morphid(TyperGroup):
    """All commands, with output streams that accept every character and survive closed pipes."""

    def main(self, *arguments: Any, **options: Any) -> Any:
        """Run a command line."""
        prepare_streams()
        try:
            return super().main(*arguments, **options)
        finally:
            flush_streams()


def print_version(wanted: bool) -> None:
    """Print the version and exit, if requested."""
    if wanted:
        from morphdata.version import VERSION

        typer.echo(f"morphid {VERSION}")
        raise typer.Exit


app = typer.Typer(
    name="morphid",
    cls=Morphid,
    epilog=EXIT_CODES,
    no_args_is_help=True,
    pretty_exceptions_show_locals=False,
)
COMMANDS: list[Callable[..., None]] = [serve, doctor, ready, *operation_commands(), paper, bench]
for command in COMMANDS:
    app.command(epilog=EXIT_CODES, cls=SeveralValues)(command)
app.add_typer(jobs, name="jobs")
app.add_typer(keys, name="keys")
app.add_typer(audit, name="audit")
app.add_typer(database, name="db")


@app.callback()
def morphid(
    *,
    _version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=print_version, help="Print the version and exit."),
    ] = False,
) -> None:
    """Fast equivalent models of sweep-morphing flexible aircraft, identified from sample flights."""


if __name__ == "__main__":
    app()
