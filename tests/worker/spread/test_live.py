"""A spread identification through the whole service: API, broker and a worker process."""

from __future__ import annotations

import time

from morphid.service import Service
from tests.identification_request import identification
from tests.live import LiveService
from tests.worker.spread.processes import spread

SEARCH = {"method": "pso", "particles": 96, "generations": 3, "seed": 5}


def test_a_spread_identification_ends(live_service: LiveService) -> None:
    """Posted with the mode `distributed` an identification goes through all its generations and ends well."""
    request = spread(identification("train_rate_0.8", links=2, search=SEARCH), chunks=3)
    with Service(live_service.url) as client:
        *_, job = client.watch(client.submit("identify", request)["id"], poll_s=0.1)
        assert job["status"] == "succeeded", live_service.logs()
        assert job["attempt"] == 1
        history = client.result(job["id"])["search"]["history"]
    assert [row["generation"] for row in history] == [0, 1, 2, 3]


def test_a_cancelled_spread_job_ends_soon(live_service: LiveService) -> None:
    """Cancelled through the API while chunks are flown it ends within seconds and leaves its best so far."""
    search = {**SEARCH, "particles": 960, "generations": 500}
    request = spread(identification("train_rate_0.8", links=3, search=search))
    with Service(live_service.url) as client:
        job_id = client.submit("identify", request)["id"]
        while not (client.job(job_id)["progress"] or {}).get("generation"):
            time.sleep(0.1)
        client.cancel(job_id)
        requested_at = time.monotonic()
        *_, job = client.watch(job_id, poll_s=0.05)
        took_s = time.monotonic() - requested_at
        assert (job["status"], job["partial"]) == ("cancelled", True)
        assert client.result(job_id)["search"]["generations"] >= 1
    print(f"cancelled within {took_s:.2f} s")
    assert took_s < 10.0  # two seconds on a quiet machine (docs/distributed.md); this one may be busy
