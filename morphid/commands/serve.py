"""``morphid serve``."""

from __future__ import annotations

from morphid.commands import options
from morphid.screen import reports_errors


@reports_errors
def serve(
    host: options.Host = None,
    port: options.Port = None,
    workers: options.Workers = None,
    data_dir: options.DataDir = None,
    as_json: options.AsJson = False,
) -> None:
    """Run API, worker and broker on this machine until Ctrl-C."""
    from morphid.configured import settings_for
    from morphid.serve import serve as run

    settings = settings_for(host=host, port=port, workers=workers, data_dir=data_dir)
    run(settings, json_events=as_json)
