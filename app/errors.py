"""The one error tree of the service: an error knows its status, its stable code, the field, the way out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from morphdata.faults import Fault, Pickled


@dataclass(eq=False)
class ServiceError(Pickled, Exception):
    """Root of the tree; carries what a problem document says."""

    detail: str = ""
    pointer: str = ""
    hint: str = ""
    faults: tuple[Fault, ...] = field(default=())

    status = 500
    code = "internal_error"
    title = "Something went wrong inside the service"
    ask_again_s: ClassVar[int | None] = None  # when a repetition may succeed

    def __post_init__(self) -> None:
        self.args = (self.detail,)  # not what a subclass was constructed of

    def __str__(self) -> str:
        return self.detail or self.title

    @property
    def headers(self) -> dict[str, str]:
        """Headers that the answer must carry (Retry-After: RFC 9110, section 10.2.3)."""
        return {} if self.ask_again_s is None else {"Retry-After": str(self.ask_again_s)}

    @property
    def members(self) -> dict[str, Any]:
        """Members of the problem document beyond the usual ones (RFC 9457, section 3.2)."""
        return {}


class InvalidRequest(ServiceError):
    """The body, a header or a parameter does not say something that can be done."""

    status = 422
    code = "invalid_request"
    title = "The request is not valid"

    @classmethod
    def of(cls, faults: Sequence[Fault]) -> InvalidRequest:
        """Bundle one or more faults; the first is told at the top."""
        first = faults[0]
        more = f" ({len(faults) - 1} more below)" if len(faults) > 1 else ""
        return cls(first.detail + more, first.pointer, first.hint, tuple(faults))


class MalformedBody(ServiceError):
    """The body is not the JSON text that was announced."""

    status = 400
    code = "malformed_body"
    title = "The body cannot be read"


class BodyTooLarge(ServiceError):
    """More bytes than the service takes."""

    status = 413
    code = "body_too_large"
    title = "The body is too large"


class UnsupportedMediaType(ServiceError):
    """A body or file of a kind that is not read here."""

    status = 415
    code = "unsupported_media_type"
    title = "This kind of content is not supported"


class NotFound(ServiceError):
    """Nothing of the caller's has this name."""

    status = 404
    code = "not_found"
    title = "Not found"


class JobNotFound(NotFound):
    """No such job, or another owner's."""

    code = "job_not_found"
    title = "There is no such job"

    def __init__(self, job_id: str) -> None:
        super().__init__(f"There is no job {job_id}.", "#path/job_id", "GET /jobs lists yours.")


class ModelNotFound(NotFound):
    """No such identified model, or another owner's."""

    code = "model_not_found"
    title = "There is no such model"

    def __init__(self, model_id: str) -> None:
        super().__init__(f"There is no model {model_id}.", "#path/model_id", "GET /models lists yours.")


class TrajectoryNotFound(NotFound):
    """No such trajectory, or another owner's."""

    code = "trajectory_not_found"
    title = "There is no such trajectory"

    def __init__(self, trajectory_id: str) -> None:
        super().__init__(
            f"There is no trajectory {trajectory_id}.",
            "#path/trajectory_id",
            "Upload it with POST /trajectories first.",
        )


class ArtifactNotFound(NotFound):
    """The job left no file of this name."""

    code = "artifact_not_found"
    title = "There is no such file"

    def __init__(self, job_id: str, name: str) -> None:
        super().__init__(
            f"Job {job_id} has no file {name!r}.",
            "#path/name",
            f"GET /jobs/{job_id}/artifacts lists its files.",
        )


class WebhookNotFound(NotFound):
    """No such webhook, or another owner's."""

    code = "webhook_not_found"
    title = "There is no such webhook"

    def __init__(self, webhook_id: str) -> None:
        super().__init__(
            f"There is no webhook {webhook_id}.", "#path/webhook_id", "GET /webhooks lists yours."
        )


class Conflict(ServiceError):
    """The thing is not in a state in which this can be done."""

    status = 409
    code = "conflict"
    title = "Not possible in this state"


class IdempotencyConflict(Conflict):
    """An idempotency key was used again for another request."""

    code = "idempotency_conflict"
    title = "The idempotency key belongs to another request"

    def __init__(self, key: str) -> None:
        super().__init__(
            f"The key {key!r} was used before with another body or operation.",
            "#header/Idempotency-Key",
            "Use a new key for a new request; reuse a key only with an identical body.",
        )


class ResultNotReady(Conflict):
    """The job has no result (yet)."""

    code = "result_not_ready"
    title = "There is no result"


class JobNotFinished(Conflict):
    """Only finished jobs can be deleted."""

    code = "job_not_finished"
    title = "The job has not ended"

    def __init__(self, job_id: str, status: str) -> None:
        super().__init__(
            f"Job {job_id} is {status}.", "#path/job_id", f"POST /jobs/{job_id}/cancel first, then delete it."
        )


class ExportFailed(Conflict):
    """The job that writes an exported file has ended without it; tells what the job tells."""

    code = "export_failed"
    title = "The model was not exported"

    def __init__(self, job_id: str, job_code: str, detail: str, pointer: str, hint: str) -> None:
        again = f"DELETE /jobs/{job_id} to have it tried again."
        super().__init__(detail, pointer, f"{hint} {again}".strip())
        self.code = job_code
        self.job_id = job_id

    @property
    def members(self) -> dict[str, Any]:
        """Where the job is."""
        return {"job": f"/jobs/{self.job_id}"}


class TooManyWebhooks(Conflict):
    """The owner has as many webhooks as one may have."""

    code = "too_many_webhooks"
    title = "There are too many webhooks"

    def __init__(self, limit: int) -> None:
        super().__init__(f"You have {limit} webhooks.", hint="Delete one that is not needed any more.")


class WebhookDisabled(Conflict):
    """A disabled webhook is sent nothing."""

    code = "webhook_disabled"
    title = "The webhook is disabled"

    def __init__(self, webhook_id: str) -> None:
        super().__init__(
            f"Webhook {webhook_id} is disabled.", "#path/webhook_id", "POST /webhooks/{id}/enable first."
        )


class WebhookPending(Conflict):
    """A webhook whose receiver has not answered the challenge is sent nothing else."""

    code = "webhook_pending"
    title = "The webhook is pending"

    def __init__(self, webhook_id: str) -> None:
        super().__init__(
            f"The receiver of webhook {webhook_id} has not answered the challenge yet.",
            "#path/webhook_id",
            "Make the receiver return the challenge; POST /webhooks/{id}/enable sends a new one.",
        )


class Unauthorized(ServiceError):
    """No key, or one that does not open: unknown, expired and revoked keys are all told the same."""

    status = 401
    code = "unauthorized"
    title = "A valid API key is needed"

    def __init__(self) -> None:
        super().__init__(
            "The request has no valid API key.",
            "#header/Authorization",
            "Send `Authorization: Bearer mid_...`; `morphid keys create` makes a key.",
        )

    @property
    def headers(self) -> dict[str, str]:
        """How to authenticate (RFC 9110, section 11.6.1)."""
        return {"WWW-Authenticate": 'Bearer realm="MorphID"'}


class MissingScope(ServiceError):
    """The key is valid and may not do this."""

    status = 403
    code = "missing_scope"
    title = "The API key lacks permission"

    def __init__(self, missing: list[str], scopes: list[str]) -> None:
        self.scopes = scopes
        super().__init__(
            f"The key lacks the scope {' '.join(missing)}.",
            "#header/Authorization",
            "Use a key with this scope: `morphid keys create --scope ...`; GET /me tells what yours may do.",
        )

    @property
    def headers(self) -> dict[str, str]:
        """What would be enough (RFC 6750, section 3.1)."""
        scope = " ".join(self.scopes)
        return {"WWW-Authenticate": f'Bearer realm="MorphID", error="insufficient_scope", scope="{scope}"'}


class TooManyRequests(ServiceError):
    """Too much, too fast; ask again later."""

    status = 429
    code = "too_many_requests"
    title = "Too many requests"

    def __init__(self, detail: str, hint: str, *, retry_after_s: int) -> None:
        self.retry_after_s = max(1, retry_after_s)
        super().__init__(detail, hint=hint)

    @property
    def headers(self) -> dict[str, str]:
        """When to ask again, s (RFC 9110, section 10.2.3)."""
        return {"Retry-After": str(self.retry_after_s)}


STREAM_ENDS_S = 5  # when to ask again for what other requests of the owner give back


class TooManyRefusals(TooManyRequests):
    """An address that keeps sending keys that do not open."""

    code = "too_many_refusals"
    title = "Too many invalid API keys from this address"

    def __init__(self, retry_after_s: int) -> None:
        super().__init__(
            "This address has sent too many invalid API keys.",
            "Correct the key and retry after the time in Retry-After.",
            retry_after_s=retry_after_s,
        )


class TooManyStreams(TooManyRequests):
    """The owner follows as many jobs at once as one may."""

    code = "too_many_streams"
    title = "Too many event streams or waiting requests at once"

    @classmethod
    def of_streams(cls, limit: int) -> TooManyStreams:
        """Tell that there are as many event streams as one owner may have."""
        return cls(
            f"You have {limit} open event streams, which is the limit.",
            "Close one that is not needed, or read the events a page at a time: Accept: application/json.",
            retry_after_s=STREAM_ENDS_S,
        )

    @classmethod
    def of_waits(cls, limit: int) -> TooManyStreams:
        """Tell that as many requests wait as one owner may have."""
        return cls(
            f"{limit} of your requests are waiting for jobs (Prefer: wait), which is the limit.",
            "Send the request without Prefer: wait, or retry when one of them has been answered.",
            retry_after_s=STREAM_ENDS_S,
        )


QUOTA_HINTS = {
    "jobs_in_flight": "Wait until a job has ended, or cancel one.",
    "flights_per_day": "Wait until midnight UTC, or use fewer particles, generations or samples.",
    "stored_bytes": "Delete jobs and flights that are not needed any more.",
}


class QuotaExceeded(TooManyRequests):
    """The key's quota has no room for this."""

    code = "quota_exceeded"
    title = "The API key's quota is used up"

    def __init__(self, quota: str, *, limit: int, used: int, asked: int, retry_after_s: int) -> None:
        self.quota, self.limit, self.used, self.asked = quota, limit, used, asked
        words = quota.replace("_", " ")
        super().__init__(
            f"The key's quota is {limit} {words}; {used} are used and this request needs {asked} more.",
            QUOTA_HINTS.get(quota, "Ask the operator for a larger quota."),
            retry_after_s=retry_after_s,
        )

    @property
    def members(self) -> dict[str, Any]:
        """Limit and use, for programs."""
        return {"quota": {"name": self.quota, "limit": self.limit, "used": self.used, "asked": self.asked}}


class CrossSiteRequest(ServiceError):
    """A web page of another site made the browser send this."""

    status = 403
    code = "cross_site_request"
    title = "Requests from pages of other sites are refused"


class WrongHost(ServiceError):
    """The request names a host that this service does not answer for."""

    status = 421
    code = "wrong_host"
    title = "The service does not accept this host name"


class DatabaseAway(ServiceError):
    """The database restarts, cannot be reached or is too busy; no promise was made."""

    status = 503
    code = "database_unavailable"
    title = "The database does not answer"
    ask_again_s = 2

    def __init__(self) -> None:
        super().__init__(
            "The database does not answer at the moment.",
            hint="Repeat the request in a few seconds; with an Idempotency-Key it makes one job at most.",
        )


class StorageFull(ServiceError):
    """The database has no room for what the request would store."""

    status = 503
    code = "storage_full"
    title = "The service's storage is full"
    ask_again_s = 60  # people have to make room

    def __init__(self) -> None:
        super().__init__(
            "The database is out of disk space; nothing was stored.",
            hint="Delete finished jobs that are not needed, or ask the operator for more disk space.",
        )


class SlowBody(ServiceError):
    """The body arrives too slowly to be worth a connection."""

    status = 408
    code = "slow_body"
    title = "The body did not arrive in time"

    def __init__(self) -> None:
        super().__init__("The body arrived too slowly, or not at all.", hint="Send it again, in one go.")

    @property
    def headers(self) -> dict[str, str]:
        """The connection is of no more use."""
        return {"Connection": "close"}


class ServiceBusy(ServiceError):
    """As many bodies or files are being read as this process can bear."""

    status = 503
    code = "service_busy"
    title = "The service is busy"
    ask_again_s = 5

    def __init__(self, detail: str = "") -> None:
        super().__init__(detail, hint="Send the request again in a few seconds.")
