"""One address means one thing, to Celery and to the health check, however it is spelled."""

from __future__ import annotations

import ssl
from collections.abc import Iterator
from pathlib import Path

import pytest
import trustme
from celery import Celery

from app.broker import canonical
from app.health.broker import NOT_TRUSTED, UNREACHABLE, broker_state
from app.jobs.queue import messages_waiting, publish
from app.settings import Settings, UnsafeSettings, load_settings
from morphid.broker import LOOPBACK, find_server, free_port
from morphid.supervisor import ChildSpec, Supervisor
from tests.servers.redis import quiet_port
from tests.servers.tls import tls_front
from tests.waiting import until
from worker.celery_app import make_app


@pytest.fixture(scope="module")
def broker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[int, Path]]:
    """A server without a password: its port, and its socket file."""
    folder = tmp_path_factory.mktemp("broker")
    port, path = free_port(quiet_port()), folder / "a socket+file;1"
    text = f'bind {LOOPBACK}\nport {port}\ndir "{folder}"\nunixsocket "{path}"\nsave ""\ndatabases 4\n'
    supervisor = Supervisor(folder / "logs", report=lambda _sentence: None)
    supervisor.start(ChildSpec(name="broker", command=[str(find_server()), "-"], stdin_text=text))
    until(lambda: broker_state(f"redis://{LOOPBACK}:{port}") == "ok")
    yield port, path
    supervisor.stop()


def worker_app(url: str) -> Celery:
    """Celery as the workers and the beat have it."""
    return make_app(Settings(database_url="sqlite:///x", broker_url=url))


def reached(url: str) -> dict[str, bool]:
    """Who of all clients reaches the broker at an address."""
    app = worker_app(url)
    try:
        with app.connection_for_read() as connection:
            connection.connect()
            read = True
    except connection.connection_errors:
        read = False
    return {"health": broker_state(url) == "ok", "API": publish("job", url), "worker": read}


EVERYBODY = {"health": True, "API": True, "worker": True}
NOBODY = {"health": False, "API": False, "worker": False}


@pytest.fixture(scope="module")
def authority() -> trustme.CA:
    """A certificate authority that is not trusted by default."""
    return trustme.CA()


@pytest.fixture(scope="module")
def authority_file(authority: trustme.CA, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its own certificate."""
    path = tmp_path_factory.mktemp("authority") / "the authority.pem"
    authority.cert_pem.write_to_path(str(path))
    return path


@pytest.fixture(scope="module", params=["ours", "another's"])
def tls_port(
    request: pytest.FixtureRequest, broker: tuple[int, Path], authority: trustme.CA
) -> Iterator[tuple[str, int]]:
    """The broker behind TLS, with a certificate for its own name or for another's."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    name = LOOPBACK if request.param == "ours" else "elsewhere.example"
    authority.issue_cert(name).configure_cert(context)
    with tls_front(broker[0], context) as port:
        yield request.param, port


@pytest.mark.parametrize(
    ("options", "right_name", "wrong_name"),
    [
        ("", False, False),
        ("?ssl_cert_reqs=required", False, False),
        ("?ssl_cert_reqs=CERT_REQUIRED", False, False),
        ("?ssl_ca_certs={ca}", True, False),
        ("?ssl_cert_reqs=CERT_REQUIRED&ssl_ca_certs={ca}", True, False),
        ("?ssl_cert_reqs=optional&ssl_ca_certs={ca}", True, False),
        ("?ssl_ca_certs={ca}&ssl_check_hostname=false", True, True),
        ("?ssl_cert_reqs=none", True, True),
        ("?ssl_cert_reqs=CERT_NONE", True, True),
    ],
)
def test_certificates_are_checked_alike(
    tls_port: tuple[str, int], authority_file: Path, options: str, *, right_name: bool, wrong_name: bool
) -> None:
    """Without a word a certificate is checked, by all; with the same word all do the same."""
    whose, port = tls_port
    url = f"rediss://{LOOPBACK}:{port}/1" + options.format(ca=str(authority_file).replace(" ", "%20"))
    good = right_name if whose == "ours" else wrong_name
    assert reached(url) == (EVERYBODY if good else NOBODY)
    if not good:
        assert broker_state(url) == NOT_TRUSTED


@pytest.mark.parametrize("spelling", ["unix://{}?db=2", "redis+socket://{}?virtual_host=2"])
def test_a_socket_file(broker: tuple[int, Path], spelling: str) -> None:
    """A socket file is one, in our spelling and in Celery's; all use the same database behind it."""
    port, path = broker
    url = spelling.format(str(path).replace(" ", "%20"))
    before = messages_waiting(f"redis://{LOOPBACK}:{port}/2")
    assert reached(url) == EVERYBODY
    assert before is not None
    assert messages_waiting(f"redis://{LOOPBACK}:{port}?db=2") == before + 1
    assert messages_waiting(f"valkey://{LOOPBACK}:{port}/2") == before + 1
    assert reached("unix:///nowhere/at/all.sock") == NOBODY
    assert broker_state("unix:///nowhere/at/all.sock") == UNREACHABLE


@pytest.mark.parametrize(
    "url",
    [
        "redis://127.0.0.1:6399/0",
        "redis://:p%2F%40ss@redis:6379/0",
        "rediss://queue.example:6380/1?ssl_cert_reqs=none",
        "unix:///run/valkey.sock",
        "amqp://elsewhere",
    ],
)
def test_a_good_spelling_stays(url: str) -> None:
    """What is spelled our way, and what is no Redis, is left alone."""
    assert canonical(url) == url


@pytest.mark.parametrize(
    ("url", "reported"),
    [
        ("rediss://h?ssl_cert_reqs=maybe", "required, optional or none"),
        ("redis://h?ssl_cert_reqs=none", "rediss://"),
        ("redis://h?no_such=1", "unknown option 'no_such'"),
        ("rediss://h/queue", "not a database number"),
        ("unix://run/valkey.sock", "full path"),
        ("unix://", "full path"),
    ],
)
def test_an_address_that_means_nothing_is_refused(url: str, reported: str) -> None:
    """Nonsense is refused at the start, in a sentence that names the setting."""
    with pytest.raises(UnsafeSettings, match="MORPHID_BROKER_URL") as caught:
        load_settings(broker_url=url)
    assert reported in str(caught.value)


def test_no_word_of_the_password_is_reported() -> None:
    """A slash in a password makes nonsense of the address; the refusal does not repeat it."""
    with pytest.raises(UnsafeSettings) as caught:
        load_settings(broker_url="redis://:hun/ter2@queue.example/0")
    assert "ter2" not in str(caught.value)
