"""What the house knows about an operation: one value, from which everything else about it is derived."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from pydantic import BaseModel

from morphdata.execution import Request

Summary = dict[str, Any]
Asked = TypeVar("Asked", bound=Request)


@dataclass(frozen=True, slots=True)
class Operation(Generic[Asked]):
    """One kind of long work.

    Routes, validation, OpenAPI document, the worker's registry, the command and the page's labels are made
    from it.

    Attributes
    ----------
    name : str
        Name of the command and, after a slash, path of the call.
    noun : str
        What a request asks for, with its article: "an identification".
    title : str
        What it does, a line.
    subject, help : str
        The same as a heading of the API's documentation, and as a sentence of the page's help.
    description : str
        What a caller must know besides.
    request, result, cost_model : type
        Models of what goes in, of what comes out, and of what it would cost.
    cost : callable
        ``cost(request)`` estimates what it would take before anything runs. Samples and models that the
        request refers to are inline by then, here and in `summary`.
    summary : callable
        ``summary(request)`` gives the few small facts that a listing of jobs shows.
    begin : str
        Where its work begins, ``package.module:function``; only workers import it.
    files : tuple of str
        Names of the files that a job may leave, as shell patterns.
    deadline_s : callable
        ``deadline_s(request)`` gives the time, s, after which a running job is ended; None leaves that to the
        service.
    model_in : callable
        ``model_in(result)`` finds the identified model in a result, as an object with its ``model`` and its
        ``fit``; None where there is none.
    """

    name: str
    noun: str
    title: str
    subject: str
    help: str
    description: str
    request: type[Asked]
    result: type[BaseModel]
    cost_model: type[BaseModel]
    cost: Callable[[Asked], BaseModel]
    summary: Callable[[Asked], Summary]
    begin: str
    files: tuple[str, ...] = ("result.json",)
    deadline_s: Callable[[Asked], float | None] = lambda _request: None
    model_in: Callable[[dict[str, Any]], dict[str, Any] | None] = lambda _result: None


def after_budget(report_s: float) -> Callable[[Any], float | None]:
    """Make the deadline of a search: its own time budget, and time to judge and draw what it found.

    Parameters
    ----------
    report_s : float
        That time, s.
    """

    def deadline_s(request: Any) -> float | None:
        budget_s: float | None = request.search.max_seconds
        return None if budget_s is None else budget_s + report_s

    return deadline_s
