"""Laws of who may send a request: a page of anyone must not be able to drive a service on loopback."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.http.origins import Boundary, refusal
from app.settings import Settings
from tests.app.running_service import DEAD_BROKER, RunningService, running_service

NAME = "morphid.example"
EVERYWHERE = "0.0.0.0"  # noqa: S104 - what the tests are about


def status(service: RunningService, method: str, path: str, headers: dict[str, str]) -> int:
    """Send exactly these headers."""
    place = service.url.removeprefix("http://")
    connection = http.client.HTTPConnection(place, timeout=10.0)
    try:
        connection.request(method, path, headers={"Host": place, **headers})
        return connection.getresponse().status
    finally:
        connection.close()


@pytest.mark.parametrize(
    "host",
    ["localhost", "LOCALHOST:8000", "127.0.0.1", "[::1]:8000", "morphid.localhost", "192.168.1.7:8000"],
)
def test_addresses_and_loopback_names_are_answered(service: RunningService, host: str) -> None:
    """Nobody can point these elsewhere."""
    assert status(service, "GET", "/jobs", {"Host": host}) == 200


@pytest.mark.parametrize(
    "host",
    [
        *(NAME, f"{NAME}:8000", "127.0.0.1.evil.example", "localhost.evil.example", "evil.example:80:80"),
        *("", "user@localhost", "localhost/x", "2130706433", "localhost.", "xn--lclhost-9wa"),
    ],
)
@pytest.mark.parametrize("path", ["/jobs", "/"])
def test_a_name_that_is_not_ours_is_not_answered(service: RunningService, host: str, path: str) -> None:
    """A page whose own name was pointed at this machine (DNS rebinding) reads nothing."""
    assert status(service, "GET", path, {"Host": host}) == 421


FROM_ELSEWHERE = [
    {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "cors", "Sec-Fetch-Dest": "empty"},
    {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors", "Sec-Fetch-Dest": "image"},
    {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "iframe"},
    {"Sec-Fetch-Site": "same-site", "Sec-Fetch-Mode": "cors", "Sec-Fetch-Dest": "empty"},
    {"Sec-Fetch-Site": "unheard-of"},
    {"Origin": "https://evil.example"},
    {"Origin": "http://127.0.0.1:1"},
    {"Origin": "null"},
    {"Origin": ""},
]


@pytest.mark.parametrize("headers", FROM_ELSEWHERE, ids=str)
@pytest.mark.parametrize(("method", "path"), [("GET", "/jobs"), ("POST", "/simulate"), ("DELETE", "/jobs/x")])
def test_pages_of_others_are_refused(
    service: RunningService, method: str, path: str, headers: dict[str, str]
) -> None:
    """Nothing that a page of another site (or of another program on this machine) sends is looked at."""
    assert status(service, method, path, headers) == 403


def test_a_form_on_another_site_posts_nothing(service: RunningService) -> None:
    """A form is a navigation too, but it is not a GET."""
    headers = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"}
    assert status(service, "POST", "/trajectories", headers) == 403


def test_links_to_the_service_work(service: RunningService) -> None:
    """A user who follows a link from elsewhere, or types the address, gets the page."""
    for site in ("cross-site", "same-site", "none"):
        headers = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"}
        assert status(service, "GET", "/", headers) == 200


def test_the_services_own_page_and_programs_are_let_in(service: RunningService) -> None:
    """Same origin by either header, or a program that sends neither."""
    place = service.url.removeprefix("http://")
    own: list[dict[str, str]] = [{"Sec-Fetch-Site": "same-origin"}, {"Origin": f"http://{place}"}, {}]
    for headers in own:
        assert status(service, "GET", "/jobs", headers) == 200
    behind_proxy = {"Origin": "http://morphid.localhost", "Host": "morphid.localhost"}
    assert status(service, "GET", "/jobs", behind_proxy) == 200


def test_no_answer_opens_the_service_to_other_sites(service: RunningService) -> None:
    """There is no CORS header, not even for a valid preflight request."""
    requested = {"Origin": "https://evil.example", "Access-Control-Request-Method": "POST"}
    requested |= {"Access-Control-Request-Headers": "authorization"}
    for headers in (requested, {}):
        answer = service.client.options("/simulate", headers=headers)
        assert answer.status_code in (403, 405)
        assert not [name for name in answer.headers if name.startswith("access-control")]


@pytest.fixture
def boundary_of(tmp_path: Path) -> Iterator[object]:
    """Settings on a database of their own."""
    return lambda **given: Boundary.of(
        Settings(database_url=f"sqlite:///{tmp_path}/x", broker_url=DEAD_BROKER, **given)
    )


def scope(server: str, client: str, host: str = "127.0.0.1") -> dict[str, object]:
    """A request as the server hands it over."""
    return {
        "type": "http",
        "method": "GET",
        "headers": [(b"host", host.encode())],
        "server": (server, 8000),
        "client": (client, 55_555),
    }


def test_an_open_service_keeps_to_loopback_however_it_listens(boundary_of: object) -> None:
    """`uvicorn --host 0.0.0.0` without MORPHID_HOST does not open the service to the network."""
    boundary = boundary_of()  # type: ignore[operator]
    assert refusal(scope("127.0.0.1", "127.0.0.1"), boundary) is None
    assert refusal(scope("::1", "::1"), boundary) is None
    socket_file = {**scope("", ""), "server": ("/run/morphid.sock", None), "client": None}
    assert refusal(socket_file, boundary) is None
    for server, client in (("192.168.1.5", "192.168.1.9"), ("127.0.0.1", "203.0.113.4")):
        error = refusal(scope(server, client), boundary)
        assert error is not None
        assert (error.code, error.status) == ("wrong_host", 421)


def test_who_opens_on_purpose_is_open(boundary_of: object) -> None:
    """MORPHID_ALLOW_OPEN answers the network, by address; by name when the name is allowed."""
    boundary = boundary_of(host=EVERYWHERE, allow_open=True, allowed_hosts=f"{NAME}, other.example")  # type: ignore[operator]
    assert refusal(scope("192.168.1.5", "192.168.1.9", "192.168.1.5:8000"), boundary) is None
    assert refusal(scope("192.168.1.5", "192.168.1.9", NAME.upper()), boundary) is None
    assert refusal(scope("192.168.1.5", "192.168.1.9", "evil.example"), boundary) is not None


def test_with_keys_names_are_restricted_on_request(boundary_of: object) -> None:
    """A foreign page has no key, so any name will do, unless the operator lists the names."""
    far = ("192.168.1.5", "203.0.113.4")
    assert refusal(scope(*far, NAME), boundary_of(host=EVERYWHERE)) is None  # type: ignore[operator]
    strict = boundary_of(host=EVERYWHERE, allowed_hosts=NAME)  # type: ignore[operator]
    assert refusal(scope(*far, NAME), strict) is None
    assert refusal(scope(*far, "evil.example"), strict) is not None


def test_refusals_are_problem_documents(service: RunningService) -> None:
    """With code, pointer and hint as every other error."""
    answer = service.client.get("/jobs", headers={"Host": "evil.example"})
    assert answer.headers["content-type"] == "application/problem+json"
    problem = json.loads(answer.text)
    assert (problem["code"], problem["pointer"]) == ("wrong_host", "#header/Host")
    assert "MORPHID_ALLOWED_HOSTS" in problem["hint"]


def test_a_service_with_keys_still_refuses_foreign_pages(tmp_path: Path) -> None:
    """A page of another site cannot find out whether a key is valid."""
    url = f"sqlite:///{tmp_path / 'service.sqlite3'}"
    with running_service(Settings(database_url=url, broker_url=DEAD_BROKER, auth="keys")) as keyed:
        assert status(keyed, "GET", "/jobs", {"Sec-Fetch-Site": "cross-site"}) == 403
        assert status(keyed, "GET", "/jobs", {"Host": NAME}) == 401
