"""Two tenants of one service, each with one thing of every kind, marked so that a leak is recognised."""

from __future__ import annotations

import copy
import json
import secrets
from dataclasses import dataclass, field
from typing import Any

import httpx
from sqlalchemy import update

from app.database import database_time
from app.jobs import store
from app.keys.records import EVERY_SCOPE, NO_QUOTA
from app.keys.service import create_key
from app.tables import webhooks
from tests.app.request_documents import (
    OPTIMIZE_RESULT,
    RESULT,
    SIMULATE_RESULT,
    STUDY_RESULT,
    Document,
    identify_document,
    optimize_document,
    simulate_document,
    study_document,
)
from tests.app.running_service import RunningService
from tests.app.webhooks.receiver import NOBODY
from tests.plain_http import CERTIFICATES

ROWS = 12  # of a sample: enough to be checked, few enough to be sent a thousand times
LEASE_S = 3600.0  # nobody renews it
FILE = "curves.csv"  # without the marker: a file's name is requested, and so appears in the response
RESULTS = {
    "identify": RESULT,
    "study": STUDY_RESULT,
    "simulate": SIMULATE_RESULT,
    "optimize": OPTIMIZE_RESULT,
}


def short_requests() -> dict[str, Document]:
    """A valid request of each operation, with few rows."""
    found = {
        "identify": identify_document(),
        "study": study_document(),
        "simulate": simulate_document(),
        "optimize": optimize_document(),
    }
    for document in found.values():
        for sample in document.get("samples", [])[1:]:
            document["samples"].remove(sample)
        for sample in document.get("samples", []):
            for name, values in sample.items():
                if isinstance(values, list):
                    sample[name] = values[:ROWS]
    return found


@dataclass
class Tenant:
    """One owner with a key.

    Attributes
    ----------
    marker : str
        Stands in everything of this tenant's, and is known to nobody else.
    ids : dict
        Name of a path parameter -> ids of this tenant's things.
    """

    owner: str
    marker: str
    key: str
    client: httpx.Client
    ids: dict[str, list[str]] = field(default_factory=dict)

    @property
    def headers(self) -> dict[str, str]:
        """What its requests carry."""
        return {"Authorization": f"Bearer {self.key}"}

    def post(self, path: str, document: Any, **headers: str) -> httpx.Response:
        """Post a JSON document, NaN and all."""
        sent = {"Content-Type": "application/json", **headers}
        return self.client.post(path, content=json.dumps(document), headers=sent)

    def made(self, path: str, document: Any, **headers: str) -> str:
        """Post what makes a thing; its id."""
        identifier: str = self.post(path, document, **headers).raise_for_status().json()["id"]
        return identifier


def new_tenant(service: RunningService, owner: str) -> Tenant:
    """Make a tenant's key and its things: jobs in all states, results, files, a flight, models, a webhook."""
    with service.database.write() as session:
        made = create_key(
            session, owner=owner, name="all", scopes=sorted(EVERY_SCOPE), quota=NO_QUOTA, expires_at=None
        )
    client = httpx.Client(base_url=service.url, timeout=30.0, verify=CERTIFICATES)
    tenant = Tenant(owner, f"marker{secrets.token_hex(8)}", made.text, client)
    client.headers.update(tenant.headers)
    replenish(service, tenant)
    return tenant


def replenish(service: RunningService, tenant: Tenant) -> None:
    """Give the tenant one more thing of every kind."""
    marker = tenant.marker
    jobs = [_job(service, tenant, operation, "succeeded") for operation in RESULTS]
    jobs += [_job(service, tenant, "simulate", status) for status in ("failed", "queued", "running")]
    sample = short_requests()["identify"]["samples"][0]
    flight = {key: value for key, value in sample.items() if key not in ("role", "weight")}
    tenant.ids = {
        "job_id": jobs,
        "trajectory_id": [tenant.made("/trajectories", {**flight, "name": marker})],
        "model_id": [model["id"] for model in client_json(tenant, "/models")["models"]],
        "webhook_id": [tenant.made("/webhooks", {"url": f"{NOBODY}?{marker}"})],
        "name": [FILE, "result.json", "report.html", "other.bin"],
    }
    with service.database.write() as session:  # its receiver would have answered, if anything were sent
        hooks = webhooks.c.id.in_(tenant.ids["webhook_id"])
        session.execute(update(webhooks).where(hooks).values(verified_at=database_time()))


def client_json(tenant: Tenant, path: str) -> Document:
    """Get a JSON document."""
    document: Document = tenant.client.get(path).raise_for_status().json()
    return document


def _job(service: RunningService, tenant: Tenant, operation: str, status: str) -> str:
    document = copy.deepcopy(short_requests()[operation])
    document["aircraft"]["name"] = tenant.marker
    document["execution"] = {"label": tenant.marker}
    job_id = tenant.made(f"/{operation}", document)
    if status == "queued":
        return job_id
    with service.database.write() as session:
        claim = store.claim_job(session, job_id, "a test", LEASE_S)
    assert claim is not None
    service.progress(claim, fraction=0.5, message=tenant.marker)
    if status == "succeeded":
        content = tenant.marker.encode()
        files = {FILE: content, "result.json": b"{}", "report.html": content, "other.bin": content}
        service.finish(claim, status, result=RESULTS[operation], artifacts=files)
    elif status == "failed":
        error = {"code": "diverged", "detail": tenant.marker, "hint": "", "pointer": ""}
        service.finish(claim, status, error=error)
    return job_id
