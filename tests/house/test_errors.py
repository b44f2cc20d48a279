"""Every error of the house arrives whole where it is sent: through pickle and out of a process pool."""

from __future__ import annotations

import importlib
import inspect
import multiprocessing
import pickle
import pkgutil
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import pytest
from starlette.exceptions import HTTPException

PACKAGES = ("app", "worker", "morphcore", "morphid", "morphdata")
SPOKEN: dict[str, Any] = {  # values of constructors' parameters, by their annotation
    "str": "a sentence",
    "int": 429,
    "float": 1.5,
    "list[str]": ["jobs:read"],
    "int | None": 7,
    "tuple[Fault, ...]": (),
    "Exit": None,
    "HTTPException": HTTPException(404, "nothing"),
}


def house_errors() -> list[type[BaseException]]:
    """Every exception class that a module of the house defines."""
    found: dict[str, type[BaseException]] = {}
    for package in PACKAGES:
        root = importlib.import_module(package)
        for module in pkgutil.walk_packages(root.__path__, f"{package}."):
            for name, item in vars(importlib.import_module(module.name)).items():
                if (
                    inspect.isclass(item)
                    and issubclass(item, BaseException)
                    and item.__module__ == module.name
                ):
                    found[f"{module.name}.{name}"] = item
    return list(found.values())


ERRORS = house_errors()


def made(kind: type[BaseException]) -> BaseException:
    """An error of a class, with a value for each parameter."""
    parameters = inspect.signature(kind.__init__).parameters.values()
    words, named = [], {}
    for parameter in list(parameters)[1:]:
        if parameter.kind is parameter.VAR_POSITIONAL:
            words.append("a sentence")
        elif parameter.kind is not parameter.VAR_KEYWORD:
            value = SPOKEN[str(parameter.annotation)]
            if parameter.annotation == "Exit":
                value = parameter.default
            if parameter.kind is parameter.KEYWORD_ONLY:
                named[parameter.name] = value
            else:
                words.append(value)
    error = kind(*words, **named)
    error.add_note("seen in a test")
    return error


def reported(error: BaseException) -> dict[str, Any]:
    """What an error carries; another error among it by its words."""
    return {
        name: str(item) if isinstance(item, BaseException) else item for name, item in vars(error).items()
    }


def test_the_walk_finds_the_trees() -> None:
    """Of every tree some leaves are among them."""
    names = {kind.__name__ for kind in ERRORS}
    assert names >= {"TrimNotFound", "UnreadableCheckpoint", "QuotaExceeded", "CommandError", "FileFault"}
    assert names >= {"StorageFull", "HttpError", "Interrupted", "UnknownOperation"}


@pytest.mark.parametrize("kind", ERRORS, ids=lambda kind: kind.__name__)
def test_an_error_survives_pickling(kind: type[BaseException]) -> None:
    """Class, words, data and notes are the same after it."""
    error = made(kind)
    again = pickle.loads(pickle.dumps(error))  # noqa: S301 - its own
    assert type(again) is type(error)
    assert (str(again), again.args, reported(again)) == (str(error), error.args, reported(error))
    assert again.__notes__ == error.__notes__


def test_an_error_comes_out_of_a_process_pool() -> None:
    """Raised in another process, each arrives here; today's pools hang where one cannot be read."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        for kind in ERRORS:
            error = made(kind)
            caught = pool.submit(exec, "raise error", {"error": error}).exception(timeout=60.0)
            assert type(caught) is kind
            assert (str(caught), reported(caught) | {"__notes__": 0}) == (
                str(error),
                reported(error) | {"__notes__": 0},
            )
