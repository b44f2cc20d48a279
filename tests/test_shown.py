"""What values show of themselves at a prompt and in a notebook."""

from __future__ import annotations

from collections.abc import Callable
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from morphcore import Aircraft, Flight, Simulation, Trajectory
from morphcore.identify import Identification, SearchSettings
from morphcore.identify.study import Study
from morphcore.shown import Summary, brief
from morphdata.identify import EquivalentModel
from morphdata.lattice import Lattice
from tests.identify.flights import (
    example,
    reference_aircraft,
    reference_documents,
    reference_flight,
    shortened,
)
from tests.optimise.morphs import last, optimisation
from tests.simulate.flights import fly

MAX_LINES = 40
WIDEST = 160
COARSE = EquivalentModel(links_per_wing=2, lattice=Lattice(chordwise=1, spanwise=4), step_s=0.01)
FLIGHTS = [shortened(example("rate_0.8"), 60), shortened(example("asymmetric", "held_out"), 60)]
QUICK = SearchSettings(method="least_squares", iterations=1)


def identified() -> Any:
    """A hurried identification's result."""
    run = Identification(reference_aircraft(), reference_flight(), FLIGHTS, COARSE, QUICK)
    *_, step = run.steps()
    return run.result(step.checkpoint)


def studied() -> Any:
    """A hurried study's result."""
    run = Study(reference_aircraft(), reference_flight(), FLIGHTS, links=(1, 2), model=COARSE, search=QUICK)
    *_, step = run.steps()
    return run.result(step.checkpoint)


def optimised() -> Any:
    """A hurried optimisation's result."""
    run = optimisation()
    return run.result(last(run).checkpoint)


def flown() -> Simulation:
    """A flight."""
    return fly(
        reference_aircraft(),
        reference_flight(),
        FLIGHTS[0],
        lattice=Lattice(chordwise=1, spanwise=4),
        step_s=0.01,
    )


RESULTS: dict[str, tuple[Callable[[], Any], tuple[str, ...]]] = {
    "identify": (identified, ("train_rate_0.8", "held_out", "J identified", "2 links")),
    "study": (studied, ("recommended", "J held out")),
    "optimise": (optimised, ("optimum", "constant", "knot times")),
    "simulate": (flown, ("theta", "sweep left", "from")),
}


class Tags(HTMLParser):
    """Counts the tags that are open."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:  # noqa: ARG002
        """One more."""
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """The last one."""
        assert self.open.pop() == tag


def require_short(value: Any) -> None:
    """A few lines of text, and HTML whose tags are closed."""
    text = repr(value)
    assert 0 < len(text.splitlines()) < MAX_LINES
    assert max(map(len, text.splitlines())) < WIDEST
    tags = Tags()
    tags.feed(value._repr_html_())
    assert tags.open == []


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_fits_a_screen(name: str) -> None:
    """It says what counts, as text and as HTML, and so does all that hangs on it."""
    make, words = RESULTS[name]
    result = make()
    require_short(result)
    for word in words:
        assert word in repr(result)
        assert word in result._repr_html_()
    for part in vars(result).values():
        assert len(repr(part).splitlines()) < MAX_LINES, type(part)


def test_what_goes_in_fits_a_screen() -> None:
    """Aircraft, flight and sample: names instead of numbers, ranges instead of columns."""
    (aircraft, flight), sample = reference_documents(), example("rate_0.8")
    for value, kind, word in (
        (aircraft, Aircraft, "right wing"),
        (flight, Flight, "150"),
        (sample, Trajectory, "(175,) from 0 to 1.74"),
    ):
        assert isinstance(value, kind)
        require_short(value)
        assert word in repr(value)


def test_long_tables_are_cut_and_text_is_escaped() -> None:
    """A hundred rows are counted, a name cannot become a tag."""
    rows = [[f"<b>{i}</b>", 1e-9 * i, None] for i in range(100)]
    summary = Summary("<script>", {"a": np.arange(10**6)}, ("name", "value", "none"), rows, ["note"])
    assert len(summary.to_text().splitlines()) < MAX_LINES
    assert "80 more rows" in summary.to_text()
    assert "<script>" not in summary.to_html()
    assert "<b>1" not in summary.to_html()
    assert brief("x" * 1000).endswith("...")
