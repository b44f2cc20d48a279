"""The error classes of the service: each has a status, a stable code, the field at fault and a hint.

Values common to all errors of a kind are in the class; the raising code adds the specific ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from morphdata.faults import Fault, Pickled


class ServiceError(Pickled, Exception):
    """Base class; carries the contents of a problem document."""

    status = 500
    code = "internal_error"
    title = "Something went wrong inside the service"
    detail = ""
    pointer = ""
    hint = ""
    retry_after_s: int | None = None  # when a repetition may succeed
    challenge: str | None = None  # how to authenticate

    def __init_subclass__(cls, *, status: int | None = None, code: str = "", title: str = "") -> None:
        cls.status, cls.code, cls.title = status or cls.status, code or cls.code, title or cls.title

    def __init__(
        self, detail: str = "", pointer: str = "", hint: str = "", faults: tuple[Fault, ...] = ()
    ) -> None:
        super().__init__(detail or self.detail)
        self.detail = detail or self.detail
        self.pointer = pointer or self.pointer
        self.hint = hint or self.hint
        self.faults = faults

    def __str__(self) -> str:
        return self.detail or self.title

    @property
    def headers(self) -> dict[str, str]:
        """Headers required in the response (RFC 9110, sections 10.2.3 and 11.6.1)."""
        headers = {"Retry-After": self.retry_after_s, "WWW-Authenticate": self.challenge}
        return {name: str(value) for name, value in headers.items() if value is not None}

    @property
    def members(self) -> dict[str, Any]:
        """Members of the problem document beyond the usual ones (RFC 9457, section 3.2)."""
        return {}


class InvalidRequest(ServiceError, status=422, code="invalid_request", title="The request is not valid"):
    """The body, a header or a parameter is invalid."""

    @classmethod
    def of(cls, faults: Sequence[Fault]) -> InvalidRequest:
        """Combine one or more faults; the first is the main one."""
        first = faults[0]
        more = f" ({len(faults) - 1} more below)" if len(faults) > 1 else ""
        return cls(first.detail + more, first.pointer, first.hint, tuple(faults))


class MalformedBody(ServiceError, status=400, code="malformed_body", title="The body cannot be read"):
    """The body is not valid JSON text."""


class BodyTooLarge(ServiceError, status=413, code="body_too_large", title="The body is too large"):
    """The body has more bytes than the service accepts."""

    hint = "Send fewer rows (10 ms steps are enough), or upload each flight with POST /trajectories."


class UnsupportedMediaType(
    ServiceError,
    status=415,
    code="unsupported_media_type",
    title="This kind of content is not supported",
):
    """A body or file of an unsupported type."""


class NotFound(ServiceError, status=404, code="not_found", title="Not found"):
    """The caller has nothing of this name."""

    thing: ClassVar[str] = "resource"

    def __init__(self, name: str) -> None:
        super().__init__(f"There is no {self.thing} {name}.", f"#path/{self.thing}_id")


class JobNotFound(NotFound, code="job_not_found", title="There is no such job"):
    """No such job, or another owner's."""

    thing = "job"
    hint = "GET /jobs lists yours."


class ModelNotFound(NotFound, code="model_not_found", title="There is no such model"):
    """No such identified model, or another owner's."""

    thing = "model"
    hint = "GET /models lists yours."


class TrajectoryNotFound(NotFound, code="trajectory_not_found", title="There is no such trajectory"):
    """No such trajectory, or another owner's."""

    thing = "trajectory"
    hint = "Upload it with POST /trajectories first."


class WebhookNotFound(NotFound, code="webhook_not_found", title="There is no such webhook"):
    """No such webhook, or another owner's."""

    thing = "webhook"
    hint = "GET /webhooks lists yours."


class ArtifactNotFound(ServiceError, status=404, code="artifact_not_found", title="There is no such file"):
    """The job left no file of this name."""

    def __init__(self, job_id: str, name: str) -> None:
        hint = f"GET /jobs/{job_id}/artifacts lists its files."
        super().__init__(f"Job {job_id} has no file {name!r}.", "#path/name", hint)


class Conflict(ServiceError, status=409, code="conflict", title="Not possible in this state"):
    """The object's present state does not allow this."""


class IdempotencyConflict(
    Conflict, code="idempotency_conflict", title="The idempotency key belongs to another request"
):
    """An idempotency key was used again for another request."""

    pointer = "#header/Idempotency-Key"
    hint = "Use a new key for a new request; reuse a key only with an identical body."

    def __init__(self, key: str) -> None:
        super().__init__(f"The key {key!r} was used before with another body or operation.")


class ResultNotReady(Conflict, code="result_not_ready", title="There is no result"):
    """The job has no result (yet)."""


class JobNotFinished(Conflict, code="job_not_finished", title="The job has not ended"):
    """Only finished jobs can be deleted."""

    def __init__(self, job_id: str, status: str) -> None:
        hint = f"POST /jobs/{job_id}/cancel first, then delete it."
        super().__init__(f"Job {job_id} is {status}.", "#path/job_id", hint)


class ExportFailed(Conflict, code="export_failed", title="The model was not exported"):
    """The job that writes an exported file ended without it; passes on the job's error."""

    def __init__(self, job_id: str, job_code: str, detail: str, pointer: str, hint: str) -> None:
        again = f"DELETE /jobs/{job_id} to let it be tried again."
        super().__init__(detail, pointer, f"{hint} {again}".strip())
        self.code = job_code
        self.job_id = job_id

    @property
    def members(self) -> dict[str, Any]:
        """Links of the job."""
        return {"job": f"/jobs/{self.job_id}"}


class TooManyWebhooks(Conflict, code="too_many_webhooks", title="There are too many webhooks"):
    """The owner has reached the limit of webhooks."""

    hint = "Delete one that is no longer needed."


class WebhookDisabled(Conflict, code="webhook_disabled", title="The webhook is disabled"):
    """A disabled webhook is sent nothing."""

    pointer = "#path/webhook_id"
    hint = "POST /webhooks/{id}/enable first."


class WebhookPending(Conflict, code="webhook_pending", title="The webhook is pending"):
    """A webhook whose receiver has not answered the challenge is sent nothing else."""

    pointer = "#path/webhook_id"
    hint = "Make the receiver return the challenge; POST /webhooks/{id}/enable sends a new one."


class Unauthorized(ServiceError, status=401, code="unauthorized", title="A valid API key is needed"):
    """No valid key. Unknown, expired and revoked keys all get this same answer."""

    detail = "The request has no valid API key."
    pointer = "#header/Authorization"
    hint = "Send `Authorization: Bearer mid_...`; `morphid keys create` makes a key."
    challenge = 'Bearer realm="MorphID"'


class MissingScope(ServiceError, status=403, code="missing_scope", title="The API key lacks permission"):
    """The key is valid but does not have the scope of the route."""

    pointer = "#header/Authorization"
    hint = "Use a key with this scope: `morphid keys create --scope ...`; GET /me shows what yours may do."

    def __init__(self, missing: list[str], scopes: list[str]) -> None:
        super().__init__(f"The key lacks the scope {' '.join(missing)}.")
        needed = " ".join(scopes)
        self.challenge = (
            f'Bearer realm="MorphID", error="insufficient_scope", scope="{needed}"'  # RFC 6750, 3.1
        )


class TooManyRequests(ServiceError, status=429, code="too_many_requests", title="Too many requests"):
    """Too many requests; retry later."""


class TooManyRefusals(
    TooManyRequests, code="too_many_refusals", title="Too many invalid API keys from this address"
):
    """An address that keeps sending invalid keys."""

    detail = "This address has sent too many invalid API keys."
    hint = "Correct the key and retry after the time in Retry-After."

    def __init__(self, retry_after_s: int) -> None:
        super().__init__()
        self.retry_after_s = retry_after_s


class TooManyStreams(
    TooManyRequests, code="too_many_streams", title="Too many event streams or waiting requests at once"
):
    """The owner has reached the limit of jobs followed at once."""

    retry_after_s = 5  # other requests of the owner may have ended by then

    @classmethod
    def of_streams(cls, limit: int) -> TooManyStreams:
        """The owner has reached the limit of open event streams."""
        hint = "Close one that is not needed, or read the events a page at a time: Accept: application/json."
        return cls(f"You have {limit} open event streams, which is the limit.", hint=hint)

    @classmethod
    def of_waits(cls, limit: int) -> TooManyStreams:
        """The owner has reached the limit of requests waiting for jobs."""
        detail = f"{limit} of your requests are waiting for jobs (Prefer: wait), which is the limit."
        hint = "Send the request without Prefer: wait, or retry when one of them has been answered."
        return cls(detail, hint=hint)


QUOTA_HINTS = {
    "jobs_in_flight": "Wait until a job has ended, or cancel one.",
    "flights_per_day": "Wait until midnight UTC, or use fewer particles, generations or samples.",
    "stored_bytes": "Delete jobs and flights that are no longer needed.",
}


class QuotaExceeded(TooManyRequests, code="quota_exceeded", title="The API key's quota is used up"):
    """The request would exceed the key's quota."""

    def __init__(self, quota: str, *, limit: int, used: int, requested: int, retry_after_s: int) -> None:
        self.quota = {"name": quota, "limit": limit, "used": used, "asked": requested}
        self.retry_after_s = max(1, retry_after_s)
        words = quota.replace("_", " ")
        super().__init__(
            f"The key's quota is {limit} {words}; {used} are used and this request needs {requested} more.",
            hint=QUOTA_HINTS.get(quota, "Ask the operator for a larger quota."),
        )

    @property
    def members(self) -> dict[str, Any]:
        """Limit and use, for programs."""
        return {"quota": self.quota}


class CrossSiteRequest(
    ServiceError,
    status=403,
    code="cross_site_request",
    title="Requests from pages of other sites are refused",
):
    """A web page of another site made the browser send this request."""

    detail = "The request comes from a web page of another site."
    pointer = "#header/Origin"
    hint = "Open the service's own page, or call the API from a program."


class WrongHost(
    ServiceError, status=421, code="wrong_host", title="The service does not accept this host name"
):
    """The Host header is not a name of this service."""


class HttpError(ServiceError):
    """Refused by the server or the framework, before any code of this service saw the request."""

    def __init__(self, status: int, code: str, title: str, detail: str = "", hint: str = "") -> None:
        super().__init__(detail or f"{title}.", hint=hint)
        self.status, self.code, self.title = status, code, title


class DatabaseAway(
    ServiceError, status=503, code="database_unavailable", title="The database does not answer"
):
    """The database restarts, is unreachable or is too busy; no change was confirmed to the client."""

    detail = "The database does not answer at the moment."
    hint = "Repeat the request in a few seconds; with an Idempotency-Key it makes one job at most."
    retry_after_s = 2


class StorageFull(ServiceError, status=503, code="storage_full", title="The service's storage is full"):
    """The database has no space for the data of the request."""

    detail = "The database is out of disk space; nothing was stored."
    hint = "Delete finished jobs that are not needed, or ask the operator for more disk space."
    retry_after_s = 60  # somebody has to free space


class SlowBody(ServiceError, status=408, code="slow_body", title="The body did not arrive in time"):
    """The body arrives too slowly to be worth a connection."""

    detail = "The body arrived too slowly, or not at all."
    hint = "Send it again, in one go."


class ServiceBusy(ServiceError, status=503, code="service_busy", title="The service is busy"):
    """This process is already reading as many bodies or files as it can handle."""

    hint = "Send the request again in a few seconds."
    retry_after_s = 5
