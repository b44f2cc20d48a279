"""What the page shows of an identification: one chart, intervals, what is doubtful, why it failed."""

from __future__ import annotations

import copy
import re
from typing import TYPE_CHECKING

import pytest

from tests.app.request_documents import RESULT, Document, identify_document, simulate_document
from tests.app.running_service import RunningService
from tests.browser.jobs import PLOT, ended, failed, posted, shown

if TYPE_CHECKING:
    from playwright.sync_api import Locator, Page

UNCERTAINTY: Document = {
    "standard_error": {"division.1": 0.011, "stiffness_nm_rad.joint_1.flap": 0.021, "lift_factor": 0.0025},
    "interval_95": {
        "division.1": [0.4784, 0.5216],
        "stiffness_nm_rad.joint_1.flap": [0.9584, 1.0416],
        "stiffness_nm_rad.joint_1.torsion": [1.2, 3.4],
        "stiffness_nm_rad.joint_1.edgewise": [None, None],
        "damping_nms_rad.joint_1.flap": [None, 0.31],
        "damping_nms_rad.joint_1.edgewise": [0.002, 45.0],
        "lift_factor": [0.99498, 1.00502],
    },
    "at_bound": ["damping_nms_rad.joint_1.torsion"],
    "correlation": [[1.0]],
    "undetermined": ["damping_nms_rad.joint_1.edgewise", "stiffness_nm_rad.joint_1.edgewise"],
    "unidentifiable": [],
}
STATISTICS = (
    *("theil", "theil_bias", "theil_variance", "theil_covariance"),
    *("lag_1", "ljung_box_p", "white", "drive_correlation"),
)
WARNINGS: list[Document] = [
    {
        "code": "mach_missing",
        "message": "alpha reaches 17 degrees in the flight",
        "hint": "lower the angle of attack",
        "pointer": "/flight/airspeed_m_s",
    },
    {"code": "at_bound", "message": "one parameter is at its bound", "hint": "widen it", "pointer": ""},
]


def result(**changes: object) -> Document:
    """Give a result of an identification with some parts of it changed."""
    return {**copy.deepcopy(RESULT), **changes}


def parameter(page: Page, group: str, title: str) -> Locator:
    """Find the row of a parameter below the heading of its group."""
    body = page.locator("tbody").filter(has=page.get_by_role("rowheader", name=group, exact=True))
    return body.locator("tr").filter(has=page.get_by_role("rowheader", name=title, exact=True))


def remark(row: Locator) -> str:
    """Give what is said below a parameter."""
    return row.locator("xpath=following-sibling::tr[1]").inner_text()


def test_intervals_stand_next_to_the_parameters(service: RunningService, page: Page) -> None:
    """An interval is a ± where it is symmetric, else two ends; both are rounded to the interval's width."""
    shown(page, service, ended(service, "identify", identify_document(), result(uncertainty=UNCERTAINTY)))

    def cells(group: str, title: str) -> list[str]:
        return parameter(page, group, title).locator("td").all_inner_texts()

    assert cells("Share of the span", "link 1") == ["0.500", "± 0.022", ""]
    assert cells("Stiffness, N m/rad", "joint 1, flap") == ["1.000", "± 0.042", ""]
    assert cells("Stiffness, N m/rad", "joint 1, torsion") == ["2.00", "1.20 to 3.40", ""]
    assert cells("Damping, N m s/rad", "joint 1, flap") == ["0.1", "at most 0.31", ""]
    assert cells("Damping, N m s/rad", "joint 1, edgewise") == ["0.30", "0.002 to 45", ""]
    assert cells("Aerodynamic corrections", "Lift factor") == ["1.0000", "± 0.0050", ""]


def test_what_the_samples_do_not_determine_is_grey(service: RunningService, page: Page) -> None:
    """A parameter that the samples hardly bound, or do not bound at all, is grey, with the reason."""
    shown(page, service, ended(service, "identify", identify_document(), result(uncertainty=UNCERTAINTY)))
    grey = page.locator("tr.undetermined")
    assert grey.count() == 2
    for group in ("Stiffness, N m/rad", "Damping, N m s/rad"):
        row = parameter(page, group, "joint 1, edgewise")
        assert "not determined" in remark(row)
        known = parameter(page, group, "joint 1, flap")
        colour = "node => getComputedStyle(node).color"
        assert row.locator("td").first.evaluate(colour) != known.locator("td").first.evaluate(colour)
    assert "at its bound" in remark(parameter(page, "Damping, N m s/rad", "joint 1, torsion"))
    assert "At a bound: damping, joint 1, torsion" in page.locator("main").inner_text()


def test_links_and_lift_factors_of_unlike_surfaces(service: RunningService, page: Page) -> None:
    """The numbers by surface in words, and each lift factor in a row of its own."""
    own = {name: RESULT["model"][name] for name in ("division", "stiffness_nm_rad", "damping_nms_rad")}
    rigid = {"division": [1.0], "stiffness_nm_rad": [], "damping_nms_rad": [], "profile_drag": 0.02}
    model = {
        **copy.deepcopy(RESULT["model"]),
        "links_per_wing": {"wing": 2, "tail": 1},
        "surfaces": {"right wing": {**own, "profile_drag": 0.01}, "right tail": rigid},
    }
    model["aero"]["lift_factors"] = {"tail": 0.9}
    text = shown(page, service, ended(service, "identify", identify_document(), result(model=model)))
    assert "1 link of tail, 2 of wing; joints" in text
    group = "Aerodynamic corrections"
    for title, value in (("Lift factor", "1"), ("tail, lift factor", "0.9")):
        assert parameter(page, group, title).locator("td").first.inner_text() == value
    assert parameter(page, "Share of the span", "right wing, link 2").count() == 1


def test_a_search_without_a_flying_model_shows_none(service: RunningService, page: Page) -> None:
    """A search that was stopped before it found a model that flies says so instead of parameters."""
    lost = {**result(model=None, warnings=WARNINGS), "partial": True}
    text = shown(page, service, ended(service, "identify", identify_document(), lost))
    assert "None was found yet that flies the samples." in text


def test_the_verdict_comes_first(service: RunningService, page: Page) -> None:
    """Grade, reasons and steps stand above warnings and tables; statistics of residuals below."""
    statistics = {
        **dict.fromkeys(STATISTICS),
        "theil": 0.012,
        "theil_bias": 0.25,
        "lag_1": 0.91,
        "white": False,
    }
    fits = copy.deepcopy(RESULT["fit"])
    fits[0]["statistics"] = {"theta": statistics, "phi": dict.fromkeys(STATISTICS)}
    verdict = {"grade": "poor", "reasons": ["The sign is wrong."], "next_steps": ["Turn it."]}
    bounds = {"lift_factor": 0.3, "division.1": 2.5e6}
    judged = result(
        verdict=verdict,
        warnings=WARNINGS,
        fit=fits,
        uncertainty={**UNCERTAINTY, "cramer_rao_percent": bounds},
    )
    text = shown(page, service, ended(service, "identify", identify_document(), judged))
    order = [
        "Verdict",
        "Do not rely on this model.",
        "The sign is wrong.",
        "Turn it.",
        "2 warnings",
        "J identified",
    ]
    places = [text.index(part) for part in order]
    assert places == sorted(places)
    assert page.locator(".card.verdict.poor .pill").inner_text() == "poor"
    row = (
        page.locator("section").filter(has=page.get_by_role("heading", name="Residuals")).locator("tbody tr")
    )
    assert row.count() == 1
    assert row.locator("td").all_inner_texts()[1:] == ["θ", "0.012", "25 %", "–", "–", "0.91", "no", "–"]
    cells = parameter(page, "Aerodynamic corrections", "Lift factor").locator("td").all_inner_texts()
    assert cells[-1] == "0.3"
    assert parameter(page, "Share of the span", "link 1").locator("td").all_inner_texts()[-1] == "> 1000"


def test_warnings_come_first(service: RunningService, page: Page) -> None:
    """Each warning with what to do and where in the request it stands, above the fit."""
    job_id = ended(service, "identify", identify_document(), result(warnings=WARNINGS))
    text = " ".join(shown(page, service, job_id).split())
    assert text.index("2 warnings") < text.index("alpha reaches 17 degrees") < text.index("J identified")
    assert "What to do: lower the angle of attack In the request: /flight/airspeed_m_s" in text
    assert text.count("In the request:") == 1, "a warning about nothing in the request has no pointer"


def test_a_result_without_uncertainty_shows_none(service: RunningService, page: Page) -> None:
    """Results of earlier versions have neither intervals nor warnings: nothing is said about them."""
    text = shown(page, service, ended(service, "identify", identify_document(), result(uncertainty=None)))
    assert "95 % interval" not in text
    assert "warning" not in text
    assert page.locator("tr.undetermined").count() == 0


def test_rounding_noise_has_no_digits(service: RunningService, page: Page) -> None:
    """An angle below a microradian and a J below its square are shown as "less than"."""
    noise = {"phi": 8.65e-15, "theta": 6.9653e-5, "psi": 0.0}
    fit = {**RESULT["fit"][0], "rms_rad": noise, "J_identified": 3.1e-26}
    ended_job = ended(service, "identify", identify_document(), result(fit=[fit]))
    shown(page, service, ended_job)
    row = page.get_by_role("row").filter(has_text="train_rate_0.5")
    assert row.get_by_role("cell").all_inner_texts() == [
        *("train_rate_0.5", "train", "0.11", "0.05", "< 10⁻¹²", "< 0.01 %", "< 0.001", "0.070", "0"),
    ]
    assert re.findall(r"\d[eE][-+]?\d", page.locator("main").inner_text()) == []


def test_a_model_that_cannot_fly_has_no_ratio(service: RunningService, page: Page) -> None:
    """Where J of the identified model is not known, the ratio to the rigid model's is not zero."""
    fit = {**RESULT["fit"][0], "J_identified": None}
    shown(page, service, ended(service, "identify", identify_document(), result(fit=[fit])))
    row = page.get_by_role("row").filter(has_text="train_rate_0.5")
    assert row.get_by_role("cell").all_inner_texts()[4:6] == ["–", "–"]


def test_one_chart_of_the_convergence(service: RunningService, page: Page) -> None:
    """The chart that grows while the search runs is the one that stays; the same plot is but a file."""
    job_id = posted(service, "identify", identify_document())
    page.goto(f"{service.url}/#/jobs/{job_id}")
    claim = service.claim(job_id)
    for generation, cost in enumerate((0.5, 0.05, 0.004)):
        service.progress(claim, fraction=0.1, generation=generation, best_cost=cost, flights=10)
    chart = page.get_by_role("img", name="Least cost over 2 generations: from 0.5 to 0.004 rad²")
    chart.wait_for(timeout=10_000)
    steps = [{"generation": i, "best_cost": 0.5 * 0.1**i} for i in range(5)]
    search = {**RESULT["search"], "history": steps}
    files = {"convergence.svg": PLOT, "picture.svg": PLOT}
    service.finish(claim, "succeeded", result=result(search=search), artifacts=files)
    whole = page.get_by_role("img", name="Least cost over 4 generations: from 0.5 to 5.00·10⁻⁵ rad²")
    whole.wait_for(timeout=10_000)
    page.get_by_role("link", name="convergence.svg").wait_for(timeout=10_000)
    assert page.get_by_role("heading", name="Convergence").count() == 1
    assert page.locator("svg.chart").count() == 1
    assert page.locator("img[src*='convergence']").count() == 0


@pytest.mark.parametrize("operation", ["identify", "simulate"])
def test_a_failed_job_says_where_and_what_to_do(service: RunningService, page: Page, operation: str) -> None:
    """The error of a job is shown with its code, hint and JSON pointer, and the page requests no result."""
    document = identify_document() if operation == "identify" else simulate_document()
    error = {"code": "trim_not_found", "detail": "no level flight", "pointer": "/flight/airspeed_m_s"}
    job_id = failed(service, operation, document, hint="raise the airspeed", **error)
    page.goto(f"{service.url}/#/jobs/{job_id}")
    page.get_by_role("heading", name="Failed: trim_not_found").wait_for(timeout=10_000)
    text = " ".join(page.locator("main").inner_text().split())
    assert "no level flight What to do: raise the airspeed In the request: /flight/airspeed_m_s" in text


def test_the_focus_stays_while_the_page_is_live(service: RunningService, page: Page) -> None:
    """The keyboard stays on the Cancel button while progress comes in, and the bar has a name."""
    job_id = posted(service, "identify", identify_document())
    page.goto(f"{service.url}/#/jobs/{job_id}")
    claim = service.claim(job_id)
    page.get_by_role("button", name="Cancel").focus()
    service.progress(claim, fraction=0.4, message="two fifths")
    page.get_by_text("two fifths").first.wait_for(timeout=10_000)
    assert page.evaluate("document.activeElement.textContent") == "Cancel"
    assert page.get_by_role("progressbar", name="progress").get_attribute("aria-valuenow") == "40"
    service.finish(claim, "failed", error={"code": "x", "detail": "y"})
