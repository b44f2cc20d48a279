"""The line of thrust: its moment is part of the balance, in every model, on every way into a flight."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight, Start
from morphcore.geometry.mirror import mirror_of
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.simulate.request import simulation_from_document
from morphcore.simulate.schedule import Hold
from morphcore.simulate.trim import Trim, trim
from morphdata.aircraft import load_aircraft
from tests.models.chains import EXAMPLES, aircraft_of, example_flight, instant
from tests.simulate.flights import fly
from tests.simulate.test_request import request
from tests.simulate.test_trim import start_rates

STILL = np.zeros((2, 3))
HEIGHT_M = 0.4
MODELS: list[dict[str, Any]] = [{"model": "rigid"}, {"model": "equivalent"}, {"model": "flexible"}]


def driven(**line: Any) -> Aircraft:
    """The example's aircraft with this line of thrust."""
    document = load_aircraft(EXAMPLES / "aircraft.json").model_dump(exclude_none=True)
    return aircraft_of(document | ({"propulsion": line} if line else {}))


def started(aircraft: Aircraft, kind: dict[str, Any], flight: Flight | None = None, **more: Any) -> Trim:
    """The trim of a flight with its wings held, which must stay level.

    From a given start, the wake is that of its angle of attack instead of the rigid model's: chains pitch by
    4e-8 rad.
    """
    if kind["model"] == "equivalent":
        kind = {"model": physical_guess(chain_model(aircraft, flight or example_flight(), 3))}
    found = fly(
        aircraft, flight or example_flight(), [Hold(), Hold()], duration_s=0.1, output_step_s=0.02,
        **kind, **more,
    )  # fmt: skip
    given = more.get("start") == "given"
    assert np.ptp(found.trajectory.theta) < (1e-7 if given else 1e-8)
    assert np.abs(found.trajectory.extra["q"]).max() < (1e-6 if given else 1e-7)
    return found.trim


@pytest.mark.parametrize("kind", MODELS, ids=lambda kind: kind["model"])
def test_thrust_above_the_reference_point_pitches_down(kind: dict[str, Any]) -> None:
    """Raised by h, the line's moment is -T h about y, and the rest needs that much less: to 1e-9.

    Angle of attack, thrust and the balance of everything else stay as they were. In flight, the aircraft
    stays in trim: nothing pitches for the tenth of a second that it flies.
    """
    low = started(driven(position_m=[0.5, 0.0, 0.0]), kind)
    high = started(driven(position_m=[0.5, 0.0, -HEIGHT_M]), kind)
    thrust = float(low.force_B[0, 0])
    assert thrust > 1.0
    np.testing.assert_allclose(high.force_B, low.force_B, atol=1e-6)
    np.testing.assert_allclose(high.alpha, low.alpha, atol=1e-10)
    np.testing.assert_allclose(high.thrust_moment_B[0], [0.0, -HEIGHT_M * thrust, 0.0], rtol=1e-8)
    needed = high.moment_B + high.thrust_moment_B
    np.testing.assert_allclose(needed, low.moment_B, atol=1e-9 * abs(low.moment_B[0, 1]) + 1e-7)
    np.testing.assert_allclose(high.moment_B[0, 1] - low.moment_B[0, 1], HEIGHT_M * thrust, rtol=1e-6)


@pytest.mark.parametrize("kind", MODELS, ids=lambda kind: kind["model"])
def test_an_inclined_line_carries_weight(kind: dict[str, Any]) -> None:
    """Thrust 0.2 rad up of body x: the force is along the line, and the wings carry that much less.

    A flexible trim is off by 1e-10 rad of angle of attack at most, 2e-5 N of lift.
    """
    line_B = np.array([np.cos(0.2), 0.0, -np.sin(0.2)])
    plain = started(driven(), kind)
    found = started(driven(position_m=[-1.0, 0.0, 0.0], direction=(3.0 * line_B).tolist()), kind)
    np.testing.assert_allclose(np.cross(found.force_B[0], line_B), 0.0, atol=2e-5)
    assert found.alpha[0] < plain.alpha[0]
    moment = np.cross([-1.0, 0.0, 0.0], found.force_B[0])
    np.testing.assert_allclose(found.thrust_moment_B[0], moment, rtol=1e-12, atol=2e-5)


def test_results_tell_the_moment_of_the_thrust() -> None:
    """The document of a flight has the moment of the thrust and that beyond it; without a line only one."""
    aircraft = load_aircraft(EXAMPLES / "aircraft.json").model_dump(exclude_none=True)
    line = {"position_m": [0.0, 0.0, -HEIGHT_M]}
    found = []
    for more in ({"propulsion": line}, {}):
        run = simulation_from_document(request(aircraft=aircraft | more))
        found.append(run.result().to_document()["trim"])
    above, plain = found
    assert "thrust_moment_b_n_m" not in plain
    assert above["thrust_moment_b_n_m"][1] == pytest.approx(-HEIGHT_M * above["force_b_n"][0], rel=1e-12)
    moment = above["moment_b_n_m"][1] + above["thrust_moment_b_n_m"][1]
    # the thrust along body x instead of the path lifts less, so that the wings carry 0.2 per cent more
    assert moment == pytest.approx(plain["moment_b_n_m"][1], rel=0.01)


def test_without_a_line_the_thrust_is_along_the_path() -> None:
    """As ever: no moment of its own, the force at the angle of attack."""
    found = started(driven(), {"model": "rigid"})
    np.testing.assert_array_equal(found.thrust_moment_B, 0.0)
    assert found.force_B[0, 2] / found.force_B[0, 0] == pytest.approx(np.tan(found.alpha[0]), rel=1e-12)


@pytest.mark.parametrize("links", [1, 3])
def test_an_asymmetric_line_is_balanced(links: int) -> None:
    """An engine on one side that points 0.1 rad outward yaws, and nothing accelerates: all of it balances."""
    aircraft = driven(position_m=[0.2, 0.6, -0.1], direction=[1.0, 0.1, 0.05])
    assert mirror_of(aircraft, example_flight()) is None
    assert mirror_of(driven(position_m=[0.2, 0.0, -0.1]), example_flight()) is not None
    model = chain_model(aircraft, example_flight(), links)
    batch = physical_guess(model)
    found = trim(model, batch, instant(model, STILL)).require()
    acting = replace(found, moment_B=found.moment_B + found.thrust_moment_B)
    rates = start_rates(model, batch, STILL, acting)
    np.testing.assert_allclose(rates[:, 4:10], 0.0, atol=1e-6)
    # the thrust's own force to the side is taken up by the trim's side force
    np.testing.assert_allclose(found.force_B[0, 1], 0.0, atol=1e-6)
    assert found.moment_B[0, 2] == pytest.approx(-found.thrust_moment_B[0, 2], abs=1e-6)


@pytest.mark.parametrize("kind", MODELS, ids=lambda kind: kind["model"])
def test_a_reported_start_can_be_given_again(kind: dict[str, Any]) -> None:
    """Force and moment that a trim reports, given as the start of the same flight, are the same flight."""
    aircraft = driven(position_m=[0.1, 0.0, -HEIGHT_M], direction=[1.0, 0.0, 0.1])
    found = started(aircraft, kind)
    start = Start(float(found.alpha[0]), found.force_B[0], found.moment_B[0])
    again = started(aircraft, kind, replace(example_flight(), start=start), start="given")
    np.testing.assert_allclose(again.thrust_moment_B, found.thrust_moment_B, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("kind", MODELS, ids=lambda kind: kind["model"])
def test_the_example_with_pods_flies(kind: dict[str, Any]) -> None:
    """It trims and stays level; its engine above pitches it down by what the rest of the moment makes up."""
    document = load_aircraft(EXAMPLES / "pods" / "aircraft.json").model_dump(exclude_none=True)
    aircraft = aircraft_of(document)
    assert mirror_of(aircraft, example_flight()) is not None
    found = started(aircraft, kind, replace(example_flight(), start=None))
    assert 0.0 < found.alpha[0] < 0.15
    np.testing.assert_allclose(found.thrust_moment_B[0, 1], -0.45 * found.force_B[0, 0], rtol=1e-12)


@pytest.mark.parametrize(
    ("line", "code", "field"),
    [
        ({}, "missing", "position_m"),
        ({"position_m": [0, 0, 0], "direction": [-1, 0, 0]}, "direction_not_forward", "direction"),
        ({"position_m": [0, 0, 0], "direction": [0, 0, 0]}, "direction_not_forward", "direction"),
        ({"position_m": [0, 0, 0], "surface": "right wing"}, "not_supported", "surface"),
    ],
)
def test_a_line_that_cannot_be_flown_is_refused(line: dict[str, Any], code: str, field: str) -> None:
    """Each mistake names its field and what to do."""
    document = load_aircraft(EXAMPLES / "aircraft.json").model_dump(exclude_none=True)
    with pytest.raises(InvalidInput) as caught:
        aircraft_of(document | {"propulsion": line})
    (fault,) = caught.value.faults
    assert (fault.code, fault.pointer) == (code, f"/aircraft/propulsion/{field}")
    assert fault.hint
