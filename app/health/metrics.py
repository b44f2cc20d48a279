"""Metrics for Prometheus: those of the database, the same in every API process, and this one's requests."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from itertools import accumulate

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector

from app.health.repository import Snapshot
from app.observability import job_counts
from app.observability.counters import Counted
from app.observability.request_metrics import REGISTRY
from morphdata.version import VERSION

FRESH_S = 2.0  # simultaneous scrapes share one query of the database
MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"
COUNTERS = {  # by the name of their rows
    job_counts.ATTEMPTS: ("morphid_job_attempts", "Claims of jobs by workers.", ("operation",)),
    job_counts.FINISHED: ("morphid_jobs_finished", "Jobs that ended, and how.", ("operation", "status")),
    job_counts.FLIGHTS: ("morphid_flights", "Flights that ended jobs have flown.", ("operation",)),
    job_counts.LEASES_LOST: ("morphid_leases_lost", "Leases that ran out: workers died or stalled.", ()),
    job_counts.CHUNK_LEASES_LOST: ("morphid_chunk_leases_lost", "Leases on chunks that ran out.", ()),
    job_counts.MESSAGES_DROPPED: (
        "morphid_messages_dropped",
        "Malformed wake-up messages that workers have dropped.",
        (),
    ),
    job_counts.REAP_ROUNDS: ("morphid_reap_rounds", "Rounds of the reaper; the count must keep rising.", ()),
    job_counts.RELEASED: ("morphid_jobs_released", "Jobs handed back by workers that shut down.", ()),
}
HISTOGRAMS = {
    job_counts.WAIT_TIME: ("morphid_job_wait_seconds", "From a job's creation to its first claim."),
    job_counts.RUN_TIME: ("morphid_job_run_seconds", "From a job's first claim to its end."),
}


class Metrics:
    """The page that Prometheus reads; `look` reads the rows."""

    def __init__(self, look: Callable[[], Snapshot]) -> None:
        self._look = look
        self._lock = threading.Lock()
        self._seen: Snapshot | None = None
        self._seen_at = float("-inf")

    def text(self) -> bytes:
        """Write the page in the text format of Prometheus (version 0.0.4)."""
        with self._lock:
            if self._seen is None or time.monotonic() - self._seen_at > FRESH_S:
                self._seen = self._look()
                self._seen_at = time.monotonic()
            seen = self._seen
        registry = CollectorRegistry()
        registry.register(_Rows(seen))
        return bytes(generate_latest(registry) + generate_latest(REGISTRY))


class _Rows(Collector):
    def __init__(self, seen: Snapshot) -> None:
        self._seen = seen

    def collect(self) -> Iterator[Metric]:
        """Give the families of metrics."""
        seen = self._seen
        yield _gauge("morphid_jobs", "Jobs by state.", "status", seen.jobs.items())
        yield _gauge("morphid_chunks", "Chunks of distributed jobs.", "status", seen.chunks.items())
        workers = {"alive": seen.workers.alive, "stalled": seen.workers.stalled}
        yield _gauge("morphid_workers", "Workers by state.", "status", workers.items())
        for name, help_text, value in (
            ("queue_depth", "Jobs waiting for a worker.", seen.jobs["queued"]),
            ("oldest_queued_seconds", "Age of the oldest waiting job.", seen.oldest_queued_s),
            ("flights_per_second", "Flights per second of all running jobs.", seen.flights_per_s),
            ("webhook_deliveries_waiting", "Webhook deliveries to be sent.", seen.deliveries_waiting),
            ("worker_slots", "Jobs that living workers can run at once.", seen.workers.slots),
            ("worker_slots_busy", "Of these, in use.", seen.workers.busy),
        ):
            yield GaugeMetricFamily(f"morphid_{name}", help_text, value)
        yield _gauge("morphid_build_info", "Version of this API process.", "version", [(VERSION, 1)])
        yield from _counters(seen.counters)
        for name, (shown, help_text) in HISTOGRAMS.items():
            yield _histogram(name, shown, help_text, seen.counters)


def _gauge(name: str, help_text: str, label: str, values: Iterable[tuple[str, float]]) -> Metric:
    family = GaugeMetricFamily(name, help_text, labels=[label])
    for value, number in values:
        family.add_metric([value], number)
    return family


def _counters(counters: Iterable[Counted]) -> Iterator[Metric]:
    for row_name, (name, help_text, labels) in COUNTERS.items():
        family = CounterMetricFamily(name, help_text, labels=labels)
        found = [each for each in counters if each.name == row_name]
        for each in found:
            family.add_metric([each.labels.get(label, "") for label in labels], each.value)
        if not labels and not found:
            family.add_metric([], 0)  # an alert on "it rose" needs the value before
        yield family


def _histogram(name: str, shown: str, help_text: str, counters: Iterable[Counted]) -> Metric:
    """Add up buckets that are counted one by one."""
    buckets: dict[str, dict[str, int]] = {}
    sums: dict[str, int] = {}
    for each in counters:
        operation = each.labels.get("operation", "")
        if each.name == name + job_counts.BUCKET:
            buckets.setdefault(operation, {})[each.labels["le"]] = each.value
        elif each.name == name + job_counts.MILLISECONDS:
            sums[operation] = each.value
    edges = [*(f"{edge:g}" for edge in job_counts.BUCKETS_S), "+Inf"]
    family = HistogramMetricFamily(shown, help_text, labels=["operation"])
    for operation, found in sorted(buckets.items()):
        totals = accumulate(found.get(edge, 0) for edge in edges)
        pairs = [(edge, float(total)) for edge, total in zip(edges, totals, strict=True)]
        family.add_metric([operation], buckets=pairs, sum_value=sums.get(operation, 0) / 1000.0)
    return family
