"""The recommendation of a study, on made-up rows."""

from __future__ import annotations

import pytest

from morphcore.identify.study_choice import recommend
from morphcore.identify.study_row import StudyRow
from morphdata.measurement import ANGLES

LARGE_RMS_RAD = 1e-2  # far above what the integration resolves


def row(
    links: int,
    J_train: float | None,
    J_held_out: float | None = None,
    *,
    held_out: bool = True,
    rms_rad: float = LARGE_RMS_RAD,
    finished: bool = True,
) -> StudyRow:
    """One row; a model of more links takes longer to fly."""
    roles = ["train", "held_out"] if held_out else ["train"]
    return StudyRow(
        links_per_wing=links,
        bodies=1 + 2 * links,
        parameters=7 * links - 3,
        J_train=J_train,
        J_held_out=J_held_out if held_out else None,
        rms_rad=dict.fromkeys(ANGLES, rms_rad),
        flight_s=0.01 * links,
        identify_s=1.0,
        flights=100,
        aero_coefficients=[],
        unseen_directions=0,
        fit=[{"role": role, "J_rigid": 1.0} for role in roles],
        model={},
        finished=finished,
    )


def test_every_link_has_to_halve_the_error() -> None:
    """J = 1, 0.1, 0.02, 0.01: the third link makes 0.45 of the error and is taken, the fourth only 0.71."""
    found = recommend([row(1, 1.0, 1.0), row(2, 0.1, 0.1), row(3, 0.02, 0.02), row(4, 0.01, 0.01)])
    assert found.links_per_wing == 3
    assert found.judged_by == "held_out"


def test_all_are_compared_not_only_neighbours() -> None:
    """Where three links gain nothing over two but four do, four it is: a flat stretch does not end it.

    Two links more have to make a quarter of the error: 0.2 is enough, 0.3 is not.
    """
    rows = [row(1, 1.0, 1.0), row(2, 0.1, 0.1), row(3, 0.09, 0.09)]
    assert recommend([*rows, row(4, 0.1 * 0.2**2, 0.1 * 0.2**2)]).links_per_wing == 4
    assert recommend([*rows, row(4, 0.1 * 0.3**2, 0.1 * 0.3**2)]).links_per_wing == 2


def test_flights_held_out_decide() -> None:
    """More links that fit ever better and predict worse are not recommended, and the reason says so."""
    rows = [row(1, 1.0, 1.0), row(2, 0.1, 1e-3), row(3, 1e-2, 2e-2), row(4, 1e-6, 0.5)]
    found = recommend(rows)
    assert found.links_per_wing == 2
    assert "With 3 links the fit is better and the prediction worse" in found.reason
    alone = recommend([row(n + 1, J, held_out=False) for n, J in enumerate((1.0, 0.1, 1e-2, 1e-6))])
    assert alone.links_per_wing == 4, "each makes a third or less of the error before"
    assert alone.judged_by == "train"
    assert "none was held out" in alone.reason


def test_below_the_resolution_nothing_is_gained() -> None:
    """An RMS that the integration does not resolve is enough, whatever more links make of it."""
    rows = [row(1, 1.0, 1.0), row(2, 1e-6, 1e-6, rms_rad=0.5e-4), row(3, 1e-12, 1e-12, rms_rad=1e-7)]
    found = recommend(rows)
    assert found.links_per_wing == 2
    assert "resolves" in found.reason
    dear = recommend([row(1, 1.0, 1.0), row(2, 2e-6, 2e-6), row(3, 1e-6, 1e-6, rms_rad=0.9e-4)])
    assert dear.links_per_wing == 2, "to get below it is worth no more than any other gain"


def test_the_reason_cites_the_figures() -> None:
    """What is recommended, how much worse fewer links are, what more would bring and cost."""
    found = recommend([row(1, 4.0, 4.0), row(2, 0.04, 0.04), row(3, 0.0324, 0.0324)])
    assert found.reason == (
        "2 links per wing: J = 0.04 rad^2 on the flights held out, RMS up to 10 mrad in an angle. "
        "The best with fewer, 1 link, has 10 times the error and takes 0.5 times as long to fly; "
        "the best with more, 3 links, has 0.9 times the error and takes 1.5 times as long to fly. "
        "An additional link must at least halve the error."
    )


def test_rows_may_come_in_any_order() -> None:
    """The order in which the numbers of links were studied does not matter."""
    rows = [row(1, 1.0, 1.0), row(2, 0.1, 0.1), row(3, 0.09, 0.09)]
    assert recommend(rows[::-1]) == recommend(rows)


@pytest.mark.parametrize(
    ("rows", "links"),
    [
        ([], None),
        ([row(1, 1.0, 1.0, finished=False)], None),
        ([row(1, 1.0, None)], None),
        ([row(1, 1.0, 1.0), row(2, 0.1, None)], 1),
        ([row(1, 0.0, 0.0), row(2, 0.0, 0.0)], 1),
        ([row(1, 1.0, 1.0), row(2, 0.0, 0.0)], 2),
    ],
)
def test_rows_without_figures_are_passed_over(rows: list[StudyRow], links: int | None) -> None:
    """Unfinished and diverged models are not recommended; none at all is an answer with a sentence."""
    found = recommend(rows)
    assert found.links_per_wing == links
    assert found.reason.endswith(".")
