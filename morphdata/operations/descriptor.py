"""The descriptor of an operation, from which everything else about it is derived."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from pydantic import BaseModel

from morphdata.execution import Request

Summary = dict[str, Any]
RequestT = TypeVar("RequestT", bound=Request)


@dataclass(frozen=True, slots=True)
class Operation(Generic[RequestT]):
    """One kind of long work.

    Routes, validation, OpenAPI document, the worker's registry, the command and the page's labels are built
    from it.

    Attributes
    ----------
    name : str
        Name of the command and, after a slash, path of the call.
    noun : str
        What is requested, with its article: "an identification".
    title : str
        One line on what it does.
    subject, help : str
        The same as a heading of the API's documentation, and as a sentence of the page's help.
    description : str
        Further information for callers.
    request, result, cost_model : type
        Models of the request, the result and the estimated cost.
    cost : callable
        ``cost(request)`` estimates the cost before anything runs. Referenced samples and models are already
        inline, here and in `summary`.
    summary : callable
        ``summary(request)`` returns the facts shown in lists of jobs.
    begin : str
        The function that starts its work, ``package.module:function``; only workers import it.
    files : tuple of str
        Names of the files that a job may produce, as shell patterns.
    deadline_s : callable
        ``deadline_s(request)`` returns the time, s, after which a running job is ended; None: the service's
        default.
    model_in : callable
        ``model_in(result)`` finds the identified model in a result, as an object with its ``model`` and its
        ``fit``; None if there is none.
    """

    name: str
    noun: str
    title: str
    subject: str
    help: str
    description: str
    request: type[RequestT]
    result: type[BaseModel]
    cost_model: type[BaseModel]
    cost: Callable[[RequestT], BaseModel]
    summary: Callable[[RequestT], Summary]
    begin: str
    files: tuple[str, ...] = ("result.json",)
    deadline_s: Callable[[RequestT], float | None] = lambda _request: None
    model_in: Callable[[dict[str, Any]], dict[str, Any] | None] = lambda _result: None


def after_budget(report_s: float) -> Callable[[Any], float | None]:
    """Make the deadline of a search: its own time budget, plus time to evaluate and plot its result.

    Parameters
    ----------
    report_s : float
        Additional time, s.
    """

    def deadline_s(request: Any) -> float | None:
        budget_s: float | None = request.search.max_seconds
        return None if budget_s is None else budget_s + report_s

    return deadline_s
