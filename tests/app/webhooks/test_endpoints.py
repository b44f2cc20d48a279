"""Laws of the endpoints of webhooks, and a job's end from row to receiver."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from sqlalchemy import select
from standardwebhooks import Webhook

from app.settings import Settings, UnsafeSettings, load_settings
from app.tables import audit_log
from app.webhooks.addresses import AddressPolicy
from app.webhooks.schemas import Challenge, Message
from app.webhooks.sender import SenderSettings
from app.webhooks.service import MAX_WEBHOOKS
from tests.app.calls import fault, post
from tests.app.request_documents import Document
from tests.app.running_service import DEAD_BROKER, RunningService, running_service
from tests.app.webhooks.hooks import ended_job, new_hook
from tests.app.webhooks.receiver import NOBODY, receiver
from tests.waiting import until


def new(service: RunningService, **document: object) -> Document:
    """Register a webhook."""
    answer = post(service, "/webhooks", {"url": NOBODY, **document})
    assert answer.status_code == 201, answer.text
    made: Document = answer.json()
    return made


def enabled(service: RunningService, url: str) -> Document:
    """Register a webhook and wait until its receiver has answered the challenge."""
    made = new(service, url=url)
    assert (made["status"], made["enabled"]) == ("pending", False)
    until(lambda: service.client.get(f"/webhooks/{made['id']}").json()["status"] == "enabled")
    return made


@pytest.fixture(autouse=True)
def _no_webhooks_are_left(request: pytest.FixtureRequest) -> Iterator[None]:
    yield
    for name in {"any_service", "service"} & set(request.fixturenames):
        client = request.getfixturevalue(name).client
        for hook in client.get("/webhooks").json()["webhooks"]:
            assert client.delete(f"/webhooks/{hook['id']}").status_code == 204


def test_the_secret_is_shown_once(any_service: RunningService) -> None:
    """The answer to the creation holds the secret, in the standard's form; no later answer does."""
    made = new(any_service)
    assert made["secret"].startswith("whsec_")
    assert made["events"] == ["job.succeeded", "job.failed", "job.cancelled", "job.expired"]
    Webhook(made["secret"])
    shown = any_service.client.get(f"/webhooks/{made['id']}").json()
    assert shown == {key: value for key, value in made.items() if key != "secret"}
    assert any_service.client.get("/webhooks").json() == {"webhooks": [shown]}


def test_deeds_are_noted(any_service: RunningService) -> None:
    """Making, enabling and deleting a webhook stand in the audit log, without its secret."""
    made = new(any_service)
    any_service.client.post(f"/webhooks/{made['id']}/enable")
    any_service.client.delete(f"/webhooks/{made['id']}")
    query = select(audit_log).where(audit_log.c.target == made["id"]).order_by(audit_log.c.at)
    with any_service.database.read() as session:
        rows = session.execute(query).all()
    assert [row.action for row in rows] == ["webhook.create", "webhook.update", "webhook.delete"]
    assert made["secret"] not in str(rows)


def test_events_are_chosen(service: RunningService) -> None:
    """Chosen events are kept, each once; others are refused by name."""
    assert new(service, events=["job.failed", "job.failed"])["events"] == ["job.failed"]
    for events in ([], ["job.started"], "job.failed", ["job.failed"] * 9):
        problem = fault(post(service, "/webhooks", {"url": NOBODY, "events": events}))
        assert problem["pointer"].startswith("/events")


@pytest.fixture(scope="module")
def strict(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    """A service with the addresses of production, at which nothing that can be sent to is registered."""
    url = f"sqlite:///{tmp_path_factory.mktemp('strict') / 's.sqlite3'}"
    settings = Settings(database_url=url, broker_url=DEAD_BROKER)
    with running_service(settings, SenderSettings(AddressPolicy())) as running:
        yield running


@pytest.mark.parametrize(
    "url", ["http://example.com/", "https://127.0.0.1/", "https://169.254.169.254/", "https://u@example.com/"]
)
def test_addresses_inside_are_refused(strict: RunningService, url: str) -> None:
    """An address to which nothing would be sent is refused at once, with its field."""
    problem = fault(post(strict, "/webhooks", {"url": url}))
    assert problem["errors"][0]["code"] == "address_refused"
    assert problem["pointer"] == "/url"


def test_there_is_an_end_to_webhooks(service: RunningService) -> None:
    """An owner has a limited number of webhooks."""
    for _ in range(MAX_WEBHOOKS):
        new(service)
    assert fault(post(service, "/webhooks", {"url": NOBODY}), 409)["code"] == "too_many_webhooks"


def test_anothers_webhook_is_not_there(any_service: RunningService) -> None:
    """Every request for another owner's webhook is 404."""
    hook_id = new_hook(any_service.database, NOBODY, owner="another")
    client = any_service.client
    for method, path in (
        ("GET", ""),
        ("DELETE", ""),
        ("POST", "/enable"),
        ("POST", "/test"),
        ("GET", "/deliveries"),
    ):
        answer = client.request(method, f"/webhooks/{hook_id}{path}")
        assert fault(answer, 404)["code"] == "webhook_not_found"
    assert client.get("/webhooks").json() == {"webhooks": []}


def test_deliveries_come_in_pages(any_service: RunningService) -> None:
    """Pages of deliveries, newest first, hold each once."""
    hook_id = new_hook(any_service.database, NOBODY)
    jobs = {ended_job(any_service.database) for _ in range(5)}
    seen: list[Document] = []
    cursor = ""
    while True:
        query = f"?limit=2{cursor and f'&cursor={cursor}'}"
        page = any_service.client.get(f"/webhooks/{hook_id}/deliveries{query}").json()
        seen += page["deliveries"]
        cursor = page["next_cursor"]
        if cursor is None:
            break
    assert {item["job_id"] for item in seen} == jobs
    ids = [item["id"] for item in seen]
    assert ids == sorted(set(ids), reverse=True)


@pytest.fixture
def development(tmp_path: Path) -> Iterator[RunningService]:
    """A service as developers run it, with webhooks to their own machine."""
    settings = Settings(
        database_url=f"sqlite:///{tmp_path / 's.sqlite3'}",
        broker_url=DEAD_BROKER,
        webhook_allow_private=True,
    )
    with running_service(settings, sending=None) as running:
        yield running


def test_a_jobs_end_arrives(development: RunningService) -> None:
    """From the end of a job, by the sender of the running service, to a receiver that verifies it."""
    with receiver() as there:
        made = enabled(development, there.url())
        job_id = ended_job(development.database)
        (got,) = there.wait_for(1)
        message = Message.model_validate(Webhook(made["secret"]).verify(got.body, got.headers))
        assert (message.type, message.data.id) == ("job.succeeded", job_id)
        assert development.client.get(message.data.links.self).json()["status"] == "succeeded"


def test_a_new_webhook_receives_nothing_until_its_receiver_answers(development: RunningService) -> None:
    """The challenge is signed; ends before its answer are dropped, no test is sent, a new challenge helps."""
    with receiver() as there:
        there.answers_challenges = False
        made = new(development, url=there.url())
        ended_job(development.database)
        (got,) = there.wait_for(1)
        challenge = Challenge.model_validate(Webhook(made["secret"]).verify(got.body, got.headers))
        assert challenge.data.webhook_id == made["id"]
        path = f"/webhooks/{made['id']}"
        until(lambda: development.client.get(path).json()["failures"] == 1)
        assert development.client.get(path).json()["status"] == "pending"
        problem = fault(development.client.post(f"{path}/test"), 409)
        assert (problem["code"], problem["pointer"]) == ("webhook_pending", "#path/webhook_id")
        there.answers_challenges = True
        assert development.client.post(f"{path}/enable").json()["status"] == "pending"
        until(lambda: development.client.get(path).json()["status"] == "enabled")
        (answered,) = there.challenges
        assert answered.headers["webhook-id"] != got.headers["webhook-id"]
        job_id = ended_job(development.database)
        until(lambda: len(there.received) == 2)
        assert json.loads(there.received[1].body)["data"]["id"] == job_id
        assert (
            development.client.post(f"{path}/enable").json()["status"] == "enabled"
        )  # no challenge is needed


def test_the_limit_holds_under_parallel_posts(any_service: RunningService) -> None:
    """Sixty posts at once make as many webhooks as one may have, and refuse the rest as documented."""
    with ThreadPoolExecutor(60) as pool:
        answers = list(pool.map(lambda _: post(any_service, "/webhooks", {"url": NOBODY}), range(60)))
    assert Counter(answer.status_code for answer in answers) == {201: MAX_WEBHOOKS, 409: 60 - MAX_WEBHOOKS}
    assert len(any_service.client.get("/webhooks").json()["webhooks"]) == MAX_WEBHOOKS


def test_a_test_message_arrives(development: RunningService) -> None:
    """A test is signed like any other message, and its fate can be read; a disabled webhook gets none."""
    with receiver() as there:
        made = enabled(development, there.url())
        sent = development.client.post(f"/webhooks/{made['id']}/test")
        assert sent.status_code == 202
        (got,) = there.wait_for(1)
        verified = Webhook(made["secret"]).verify(got.body, got.headers)
        assert verified["type"] == "webhook.test"
        assert got.headers["webhook-id"] == sent.json()["id"]
        path = f"/webhooks/{made['id']}/deliveries"

        def newest() -> Document:
            return development.client.get(path).json()["deliveries"][0]

        until(lambda: newest()["status"] != "waiting")
        shown = newest()
        assert (shown["status"], shown["tries"], shown["response_status"]) == ("delivered", 1, 204)


def test_disabled_webhooks_show_why_and_can_be_enabled(any_service: RunningService) -> None:
    """Why a webhook is disabled can be read; no test is sent to it; enabled, it is challenged again."""
    from app.webhooks.deliveries import disable

    hook_id = new(any_service)["id"]
    with any_service.database.write() as session:
        disable(session, hook_id, "The receiver answered 410.")
    shown = any_service.client.get(f"/webhooks/{hook_id}").json()
    assert (shown["status"], shown["enabled"], shown["disabled_reason"]) == (
        "disabled",
        False,
        "The receiver answered 410.",
    )
    answer = any_service.client.post(f"/webhooks/{hook_id}/test")
    assert fault(answer, 409)["code"] == "webhook_disabled"
    enabled = any_service.client.post(f"/webhooks/{hook_id}/enable").json()
    assert (enabled["status"], enabled["disabled_at"], enabled["failures"]) == ("pending", None, 0)


def test_private_addresses_are_for_one_machine() -> None:
    """A service that others can reach refuses to start with webhooks into its own network."""
    with pytest.raises(UnsafeSettings, match="WEBHOOK_ALLOW_PRIVATE"):
        load_settings(host="192.0.2.1", allow_open=True, webhook_allow_private=True)
