"""The Celery application of the workers: messages are only wake-up hints; the job table is authoritative.

`worker.process` starts it, for `morphid serve` and docker-compose.yml.
"""

from __future__ import annotations

import contextlib
import logging
from typing import Any

from celery import Celery
from celery.signals import (
    setup_logging,
    worker_init,
    worker_process_init,
    worker_process_shutdown,
    worker_ready,
    worker_shutdown,
    worker_shutting_down,
)
from kombu.exceptions import OperationalError

from app.jobs.queue import QUEUE
from app.jobs.transport import celery_broker
from app.observability.logs import configure_logging
from app.observability.tracing import stop_tracing
from app.settings import Settings, doubtful_variables, settings_or_exit
from worker import numerics, shutdown
from worker.hints import REAP
from worker.presence import Presence
from worker.row_watch import RowWatch

log = logging.getLogger(__name__)

# judged by the worker's clock, which may be hours off: a short-lived message would never reach it
REAP_EXPIRES_S = 24 * 3600.0


def make_app(settings: Settings) -> Celery:
    """Configure Celery for work that is tracked in our own tables."""
    broker = celery_broker(settings.broker_url, "worker.transport:Transport")
    celery = Celery("morphid", include=["worker.tasks"])
    celery.conf.update(
        broker,
        task_default_queue=QUEUE,
        task_acks_late=False,  # redelivery by visibility timeout would run an hour-long job twice
        worker_prefetch_multiplier=1,
        worker_disable_prefetch=True,  # a busy worker must not hold a hint that an idle one could take
        worker_concurrency=settings.workers,
        worker_hijack_root_logger=False,
        worker_send_task_events=False,
        worker_enable_remote_control=False,  # workers are not controlled through the broker
        worker_consumer="worker.consumer:IndependentConsumer",
        worker_pool_start_method="fork",  # children inherit the pipe of `worker.shutdown`
        broker_connection_retry_on_startup=True,
        broker_connection_max_retries=None,
        broker_channel_error_retry=True,  # a broker that is full or faulty is treated as unavailable
        task_serializer="json",
        accept_content=["json"],
        beat_schedule={
            "reap": {
                "task": REAP,
                "schedule": settings.reap_every_s,
                "options": {"expires": REAP_EXPIRES_S, "queue": QUEUE},
            }
        },
    )
    celery.steps["worker"].update((RowWatch, Presence))
    return celery


def threads_per_job() -> int:
    """Numeric threads per job: this machine's cores shared by the jobs that run concurrently."""
    return numerics.share_cores(app.conf.worker_concurrency)


settings = settings_or_exit()
app = make_app(settings)


@setup_logging.connect
def _log_in_our_way(**_: Any) -> None:
    configure_logging(settings.log_format, settings.log_level)
    for sentence in doubtful_variables():
        log.warning(sentence)


@worker_init.connect
def _before_the_pool(sender: Any, **_: Any) -> None:
    shutdown.arm()
    if isinstance(sender.concurrency, int):  # `--concurrency` comes before MORPHID_WORKERS
        app.conf.worker_concurrency = sender.concurrency
    numerics.prepare_environment(threads_per_job())


@worker_process_init.connect
def _in_each_child(**_: Any) -> None:
    from worker import tasks

    tasks.enter_process()


@worker_process_shutdown.connect
def _at_the_end_of_each_child(**_: Any) -> None:
    stop_tracing()


@worker_ready.connect
def _look_at_the_table(**_: Any) -> None:
    # leases lost while no worker was running need not wait for the beat
    with contextlib.suppress(OperationalError):  # the beat will repeat it
        app.send_task(REAP, kwargs={"republish_after_s": 0.0}, queue=QUEUE, expires=REAP_EXPIRES_S)


@worker_shutting_down.connect
def _announce_shutdown(**_: Any) -> None:
    shutdown.announce()


@worker_shutdown.connect
def _after_the_pool(**_: Any) -> None:
    shutdown.disarm()
