"""Latency and number of HTTP requests of this API process.

Each of several API processes reports its own; Prometheus adds them up by scraping each.
"""

from __future__ import annotations

from prometheus_client import CollectorRegistry, Gauge, Histogram

LATENCY_BUCKETS_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0)

REGISTRY = CollectorRegistry()

LATENCY = Histogram(
    "morphid_http_request_seconds",
    "Time until a response starts. waited: the caller chose to wait for a job's end (Prefer: wait).",
    ("method", "route", "status", "waited"),
    buckets=LATENCY_BUCKETS_S,
    registry=REGISTRY,
)
IN_FLIGHT = Gauge(
    "morphid_http_requests_in_flight",
    "Requests in progress, including open event streams.",
    registry=REGISTRY,
)
