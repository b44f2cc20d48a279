"""``morphid serve``: broker, API, worker and beat as supervised children of one command."""

from __future__ import annotations

import fcntl
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from typing import TYPE_CHECKING

from app.private_files import OTHERS, close_to_others, make_private_folder, open_private
from morphid.broker import bound_port, in_url, prepare_broker
from morphid.database import migrate
from morphid.exits import CommandError, Exit
from morphid.screen import print_json_line, stderr, stdout
from morphid.supervisor import Child, ChildSpec, Supervisor
from worker.numerics import ensure_cache

if TYPE_CHECKING:
    from app.settings import Settings

BROKER_WITHIN_S = 10.0
API_WITHIN_S = 30.0
WORKER_STOP_S = 25.0  # s in which a running job is checkpointed and handed back
LOCK_NAME = "serve.lock"


class Announcer:
    """Reports events to the user, as sentences or as JSON lines."""

    def __init__(self, *, json_events: bool) -> None:
        self._json = json_events

    def event(self, kind: str, sentence: str, **data: object) -> None:
        """Announce one event."""
        if self._json:
            print_json_line({"event": kind, "message": sentence, **data})
        else:
            stdout().print(sentence, markup=False, soft_wrap=True)


def serve(settings: Settings, *, json_events: bool) -> None:
    """Run the service until Ctrl-C or SIGTERM.

    Parameters
    ----------
    settings : address of the API (port 0 selects a free one), jobs at once, data directory and all others.
    json_events : one JSON object per line instead of sentences.
    """
    from app.database import upgrade

    announcer = Announcer(json_events=json_events)
    ensure_cache()  # here, where its warning is visible; the workers inherit the folder
    data_dir = settings.data_dir
    with _own_data_dir(data_dir):
        port = _api_port(settings.host, settings.port)
        environment = _environment(settings, port)
        migrate(upgrade, settings.database_url)
        supervisor = Supervisor(
            data_dir / "logs", report=lambda sentence: announcer.event("restart", f"morphid: {sentence}")
        )
        supervisor.on_signals()
        try:
            _start_children(supervisor, environment, settings, port)
            if not supervisor.stopping:
                url = f"http://{in_url(settings.host)}:{port}"
                announcer.event(
                    "ready",
                    f"MorphID is ready at {url} (documentation at {url}/docs, logs in {data_dir / 'logs'}). "
                    "Ctrl-C ends it.",
                    url=url,
                    pid=os.getpid(),
                    children={name: child.pid for name, child in supervisor.children.items()},
                )
                supervisor.watch()
        finally:
            announcer.event("stopping", "morphid: ending")
            supervisor.stop()


def _start_children(
    supervisor: Supervisor, environment: dict[str, str], settings: Settings, port: int
) -> None:
    if not settings.names_broker:
        broker = prepare_broker(settings.data_dir)
        environment["MORPHID_BROKER_URL"] = broker.url
        _expect(supervisor, supervisor.start(broker.spec), broker.answers, BROKER_WITHIN_S)
    if supervisor.stopping:
        return
    api = supervisor.start(api_process(environment, settings.host, port))
    # the worker loads while the API does; an early wake-up waits in the queue
    supervisor.start(worker_process(environment, settings.workers))
    supervisor.start(beat_process(environment))
    _expect(supervisor, api, lambda: _alive(settings.host, port), API_WITHIN_S)


def _expect(supervisor: Supervisor, child: Child, ready: Callable[[], bool], within_s: float) -> None:
    if supervisor.wait_until(child, ready, within_s) or supervisor.stopping:
        return
    state = "ended" if child.exit_code is not None else f"did not answer within {within_s:g} s"
    raise CommandError(
        f"the {child.spec.name} {state}; the end of its log {child.log_path}:\n{child.last_words()}",
        code=Exit.ENVIRONMENT,
        hint="fix the problem in the log and start again",
    )


def api_process(environment: dict[str, str], host: str, port: int) -> ChildSpec:
    """The API on a port."""
    return ChildSpec("api", _python("app.http.server", "--host", host, "--port", str(port)), environment)


def worker_process(environment: dict[str, str], slots: int) -> ChildSpec:
    """A worker for a number of concurrent jobs."""
    command = _python("worker.process", "worker", "--concurrency", str(slots))
    return ChildSpec("worker", command, environment, stop_within_s=WORKER_STOP_S)


def beat_process(environment: dict[str, str]) -> ChildSpec:
    """The beat; separate from the worker, so that jobs of a dead worker are still found."""
    return ChildSpec("beat", _python("worker.process", "beat"), environment)


def _python(module: str, *arguments: str) -> list[str]:
    """Command to run one of our modules; nothing is imported from the working folder (-P)."""
    return [sys.executable, "-P", "-m", module, *arguments]


def _environment(settings: Settings, port: int) -> dict[str, str]:
    """Pass options on as environment variables, which the children read."""
    return {
        "MORPHID_DATA_DIR": str(settings.data_dir),
        "MORPHID_HOST": settings.host,
        "MORPHID_PORT": str(port),
        "MORPHID_DATABASE_URL": settings.database_url,
        "MORPHID_WORKERS": str(settings.workers),
        "PYTHONUNBUFFERED": "1",
    }


@contextmanager
def _own_data_dir(home: Path) -> Iterator[None]:
    """Create the data directory and lock it."""
    try:
        make_private_folder(home)
        _close_to_others(home)
        lock = open_private(home / LOCK_NAME, "a")
    except OSError as error:
        raise CommandError(
            f"the data directory {home} cannot be written: {error.strerror}",
            code=Exit.ENVIRONMENT,
            hint="choose another: morphid serve --data-dir DIR",
        ) from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise CommandError(
                f"another `morphid serve` uses the data directory {home}",
                code=Exit.ENVIRONMENT,
                hint="stop it first, or choose another: morphid serve --data-dir DIR",
            ) from None
        yield


def _close_to_others(home: Path) -> None:
    """Make a data directory of ours private; report what is done with an existing one.

    The mode of a directory with other contents, such as a home directory, is not changed. The files we write
    there are private in any case.
    """
    names = {path.name for path in home.iterdir()}
    if not home.stat().st_mode & OTHERS:
        return
    if (not names or LOCK_NAME in names) and close_to_others(home):
        notice = f"the data directory {home} was open to other users; access is now restricted to you"
    else:
        notice = f"other users may list {home}, not read what MorphID writes there; chmod 700 closes it"
    stderr().print(f"morphid: {notice}", markup=False, soft_wrap=True)


def _api_port(host: str, port: int) -> int:
    try:
        return bound_port(host, port)
    except OSError as error:
        raise CommandError(
            f"cannot listen on {host} port {port}: {error.strerror}",
            code=Exit.ENVIRONMENT,
            hint="another program may use it; take any free port with `morphid serve --port 0`",
        ) from None


def _alive(host: str, port: int) -> bool:
    try:
        with closing(HTTPConnection(in_url(host), port, timeout=1.0)) as link:  # ignores proxies
            link.request("GET", "/livez")
            return link.getresponse().status == HTTPStatus.OK
    except (HTTPException, OSError):
        return False
