"""The one error tree of the service: an error knows its status, its stable code, the field, the way out."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is wrong in a request.

    Attributes
    ----------
    code : str
        Stable and machine-readable, ``sweep_out_of_range``.
    detail : str
        A sentence for people.
    pointer : str
        JSON pointer (RFC 6901) into the body, or ``#header/Name``, ``#query/name``, ``#path/name``;
        empty: the whole.
    hint : str
        What to do about it.
    """

    code: str
    detail: str
    pointer: str = ""
    hint: str = ""


@dataclass(eq=False)
class ServiceError(Exception):
    """Root of the tree; carries what a problem document says."""

    detail: str = ""
    pointer: str = ""
    hint: str = ""
    faults: tuple[Fault, ...] = field(default=())

    status = 500
    code = "internal_error"
    title = "Something went wrong inside the service"

    def __str__(self) -> str:
        return self.detail or self.title


class InvalidRequest(ServiceError):
    """The body, a header or a parameter does not say something that can be done."""

    status = 422
    code = "invalid_request"
    title = "The request is not valid"

    @classmethod
    def of(cls, faults: list[Fault]) -> InvalidRequest:
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
    title = "There is nothing here"


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


class Conflict(ServiceError):
    """The thing is not in a state in which this can be done."""

    status = 409
    code = "conflict"
    title = "Not in this state"


class IdempotencyConflict(Conflict):
    """An idempotency key was used again for another request."""

    code = "idempotency_conflict"
    title = "The idempotency key belongs to another request"

    def __init__(self, key: str) -> None:
        super().__init__(
            f"The key {key!r} was used before with another body or operation.",
            "#header/Idempotency-Key",
            "Make a new key for a new request; repeat a key only with the very same body.",
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
