"""Further actions in the transaction in which a job changes or ends.

The job store does not depend on counters, quotas, models or webhooks: they subscribe here. Every process that
changes jobs imports this module. The order determines the order of locks, the same in every process.
"""

from __future__ import annotations

from app.jobs.rows import JOBS, drop_state
from app.keys.quota import settle
from app.models.extraction import store_extracted
from app.observability.job_counts import count_change
from app.webhooks.outbox import note_end

JOBS.on_change.append(count_change)
JOBS.on_end = (settle, store_extracted, note_end, drop_state)
