"""Output channels: each by an independent route, in every model, at no cost where they are not requested."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from morphcore.errors import InvalidInput
from morphcore.frames import quaternion_from_euler, rotation_from_quaternion
from morphcore.models.equivalent import physical_guess
from morphcore.simulate import chain_flight as flying
from morphcore.simulate.channels import CHANNELS, Channel
from morphcore.simulate.flight import Simulation, write_trajectory_csv
from morphcore.simulate.request import trajectory_document
from morphcore.simulate.trajectory import load_trajectory
from morphdata.channels import CHANNELS as KNOWN
from morphdata.channels import default_channels, document_name
from morphdata.environment import Environment
from morphdata.lattice import Lattice
from morphdata.simulate import SimulateRequest
from tests.app.request_documents import simulate_document
from tests.models.chains import Swing, example_aircraft, example_flight
from tests.simulate.flights import example_model, fly

Array = np.ndarray[Any, Any]

COARSE = Lattice(chordwise=1, spanwise=4)
WIND_N = np.array([4.0, -9.0, 2.0])
SMOOTH = [Swing(0.15, 5.0), Swing(0.1, 4.0)]  # right, left: no corner of the rate
EVERY = [each.name for each in KNOWN]
OF_BEAMS = [each.name for each in KNOWN if "flexible" in each.models]
MODELS = ["rigid", "equivalent", "flexible"]


def flown(
    kind: str, channels: list[str] | None = None, schedules: list[Swing] = SMOOTH, **options: Any
) -> Simulation:
    """0.4 s of the example aircraft on a coarse lattice, in a steady wind."""
    flight = replace(example_flight(), wind_N=WIND_N)
    if channels is None:
        channels = OF_BEAMS if kind == "flexible" else EVERY
    model: Any = physical_guess(example_model(3)) if kind == "equivalent" else kind
    options = {"step_s": 0.001 if kind == "flexible" else 0.0025, "duration_s": 0.4, **options}
    return fly(
        example_aircraft(), flight, schedules, model=model, lattice=COARSE, elements=3, channels=channels,
        **options,
    )  # fmt: skip


def body_axes(found: Simulation, vectors_N: Array) -> Array:
    """Vectors (k, 3) of N in B."""
    R_NB = rotation_from_quaternion(quaternion_from_euler(*found.trajectory.euler.T))
    return np.asarray(np.einsum("kij,ki->kj", R_NB, vectors_N))


def columns(found: Simulation, *names: str) -> Array:
    """Columns (k, n) of a flight."""
    return np.stack([found.trajectory.extra[name] for name in names], axis=1)


def test_both_lists_hold_the_same_channels() -> None:
    """What documents know is what can be computed, in the same order; units are one of few."""
    assert [channel.name for channel in CHANNELS] == EVERY
    assert len(set(EVERY)) == len(EVERY)
    assert {channel.unit for channel in CHANNELS} == {"rad/s", "m/s", "m", "rad", "m/s^2", "1", "N m", "N"}


def test_the_page_on_formats_lists_them(root: Path) -> None:
    """docs/formats.md has a row for every channel, with its unit and meaning."""
    text = (root / "docs" / "formats.md").read_text(encoding="utf-8")
    per = {"": "", "surface": " (per surface)", "drive": " (per drive)"}
    for each in KNOWN:
        unit = "" if each.unit == "1" else each.unit
        assert f"| `{each.name}`{per[each.per]} | {unit} | {each.description} |" in text


def test_a_flight_without_a_request_has_the_columns_of_the_examples() -> None:
    """Names and order of the sample flights; the same channels by name give the same bits."""
    names = ["p", "q", "r", "vx", "vy", "vz", "x", "y", "z", "tip_left_z", "tip_right_z"]
    assert default_channels() == names
    usual = fly(
        example_aircraft(), example_flight(), SMOOTH, model="rigid", lattice=COARSE, duration_s=0.1
    ).trajectory
    named = fly(
        example_aircraft(), example_flight(), SMOOTH, model="rigid", lattice=COARSE, duration_s=0.1,
        channels=EVERY,
    ).trajectory  # fmt: skip
    assert list(usual.extra) == names
    for name in names:
        np.testing.assert_array_equal(usual.extra[name], named.extra[name])
    np.testing.assert_array_equal(usual.euler, named.euler)


@pytest.mark.parametrize("kind", MODELS)
def test_the_air_is_met_as_attitude_velocity_and_wind_say(kind: str) -> None:
    """From alpha, beta and airspeed comes the velocity over ground again: wind and heading are in it."""
    found = flown(kind)
    alpha, beta, speed = columns(found, "alpha", "beta", "airspeed").T
    through_air_B = np.stack(
        [speed * np.cos(alpha) * np.cos(beta), speed * np.sin(beta), speed * np.sin(alpha) * np.cos(beta)],
        axis=1,
    )
    expected = body_axes(found, columns(found, "vx", "vy", "vz") - WIND_N)
    np.testing.assert_allclose(through_air_B, expected, rtol=0.0, atol=1e-10)
    assert alpha[0] == pytest.approx(found.trim.alpha[0], abs=1e-9)
    assert beta[0] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(beta[-1]) > 1e-4, "uneven sweeps yaw"


def test_a_gust_from_below_raises_alpha_at_once() -> None:
    """The air that is subtracted is the gust's too: before the aircraft has moved, alpha is w / V more."""
    gust = Environment.parse({"gust": {"amplitude_m_s": 3.0, "gradient_m": 30.0, "start_s": 0.1}})
    found = flown("rigid", ["alpha"], [Swing(0.0, 1.0)] * 2, environment=gust, duration_s=0.3)
    alpha, time_s = found.trajectory.extra["alpha"], found.trajectory.time_s
    early = int(np.searchsorted(time_s, 0.149))
    upward = 1.5 * (1.0 - np.cos(np.pi * 150.0 * (time_s[early] - 0.1) / 30.0))
    assert alpha[early] - alpha[0] == pytest.approx(upward / 150.0, rel=0.15)


@pytest.mark.parametrize("kind", MODELS)
def test_specific_force_is_the_change_of_velocity_without_gravity(kind: str) -> None:
    """Central differences of the velocity over ground, less gravity: within their own error of h^2 / 6.

    The flexible model starts with a jump of the hinges' acceleration that its bending answers by ringing, so
    its first tenth of a second is left out.
    """
    found = flown(kind)
    step_s = found.trajectory.time_s[1]
    velocity = columns(found, "vx", "vy", "vz")
    acceleration_N = (velocity[2:] - velocity[:-2]) / (2.0 * step_s)
    gravity_N = np.array([0.0, 0.0, example_flight().gravity_m_s2])
    expected = body_axes(found, np.pad(acceleration_N, ((1, 1), (0, 0)), mode="edge") - gravity_N)
    late = slice(10, -1)
    force = columns(found, "fx", "fy", "fz")
    np.testing.assert_allclose(force[late], expected[late], rtol=0.0, atol=0.004 * np.ptp(force[:, 2]))


@pytest.mark.parametrize("kind", MODELS)
def test_level_flight_has_a_load_factor_of_one(kind: str) -> None:
    """In trim nx = sin(alpha), ny = 0, nz = cos(alpha): up is positive, the weight the flight's own."""
    found = flown(kind, ["nx", "ny", "nz", "fz"], [Swing(0.0, 1.0)] * 2, duration_s=0.05)
    alpha = float(found.trim.alpha[0])
    expected = [np.sin(alpha), 0.0, np.cos(alpha)]
    # trim holds angles to 1e-11 rad in the chains and residual forces to 1e-6 of the weight in the beams
    np.testing.assert_allclose(columns(found, "nx", "ny", "nz")[0], expected, rtol=0.0, atol=1e-5)
    assert found.trajectory.extra["fz"][0] < -9.0


@pytest.mark.parametrize("kind", ["equivalent", "flexible"])
def test_tips_of_every_surface(kind: str) -> None:
    """By surface they are those by side; the twist is what torsion and bending make of the tip's axes."""
    found = flown(kind)
    for side in ("left", "right"):
        np.testing.assert_array_equal(
            found.trajectory.extra[f"tip_z_{side}_wing"], found.trajectory.extra[f"tip_{side}_z"]
        )
    if kind == "equivalent":
        # of one gimbal the twist is its torsion; of two small ones their sum, to second order
        flap, torsion, _ = found.trim.q_joint[0].reshape(2, 2, 3)[0].T
        assert found.trajectory.extra["tip_twist_right_wing"][0] == pytest.approx(
            torsion.sum(), abs=flap.sum() ** 2
        )
    assert found.trajectory.extra["tip_twist_right_wing"][0] > 1e-3, "lift ahead of the axis: nose up"


def test_twist_mirrors_and_does_not_know_sweep() -> None:
    """Swapped hinge motions swap both twists, and rigid wings have none however they sweep."""
    one, other = flown("equivalent"), flown("equivalent", None, SMOOTH[::-1])
    np.testing.assert_allclose(
        one.trajectory.extra["tip_twist_left_wing"], other.trajectory.extra["tip_twist_right_wing"], atol=1e-9
    )
    assert np.all(flown("rigid").trajectory.extra["tip_twist_left_wing"] == 0.0)


@pytest.mark.parametrize("kind", ["rigid", "equivalent"])
def test_half_an_aircraft_gives_the_channels_of_the_whole(kind: str) -> None:
    """Motors, twists and forces where one half is flown are those of two halves that nearly do the same."""
    even = flown(kind, None, [SMOOTH[0], SMOOTH[0]])
    nearly = flown(kind, None, [SMOOTH[0], replace(SMOOTH[0], amplitude=0.15 + 1e-7)])
    for name, column in even.trajectory.extra.items():
        scale = max(1.0, float(np.abs(column).max()))
        np.testing.assert_allclose(
            column, nearly.trajectory.extra[name], rtol=0.0, atol=1e-5 * scale, err_msg=name
        )
    assert np.abs(even.trajectory.extra["hinge_torque_sweep_left"]).max() > 10.0


def test_channels_that_are_not_requested_are_not_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without loads the flight records no whole states, and neither torque nor twist is evaluated."""
    recorded: list[int] = []
    fly_batch = flying.fly_batch

    def counted(*conditions: Any, record_rows: int, **options: Any) -> Any:
        recorded.append(record_rows)
        return fly_batch(*conditions, record_rows=record_rows, **options)

    def refused(*_conditions: Any) -> Any:
        raise AssertionError("nobody has requested this")

    monkeypatch.setattr(flying, "fly_batch", counted)
    monkeypatch.setattr(flying, "torques_and_rates", refused)
    monkeypatch.setattr(flying, "_tips_twist", refused)
    flown("equivalent", ["alpha", "q"], duration_s=0.05)
    assert recorded == [13 + 12]  # the fuselage's, and the joints' angles
    with pytest.raises(AssertionError, match="requested"):
        flown("equivalent", ["nz"], duration_s=0.05)
    assert recorded[-1] == example_model(3).state_rows


def test_output_rows_apart_have_the_values_of_rows_close_together() -> None:
    """What is evaluated at some grid times alone is the same there."""
    fine, coarse = flown("equivalent"), flown("equivalent", output_step_s=0.05)
    for name, column in coarse.trajectory.extra.items():
        np.testing.assert_allclose(
            column, fine.trajectory.extra[name][::5], rtol=1e-9, atol=1e-9, err_msg=name
        )


def test_a_flight_with_every_channel_is_a_sample_again(tmp_path: Any) -> None:
    """The file holds them all by name, and the document with their units."""
    found = flown("equivalent").trajectory
    write_trajectory_csv(found, tmp_path / "flight.csv")
    read = load_trajectory(tmp_path / "flight.csv")
    assert list(read.extra) == list(found.extra)
    for name, column in found.extra.items():
        np.testing.assert_allclose(read.extra[name], column, rtol=1e-8, atol=1e-300)
    named = trajectory_document(found)
    for name in (
        "alpha_rad",
        "airspeed_m_s",
        "fz_m_s2",
        "nz",
        "tip_z_left_wing_m",
        "tip_twist_left_wing_rad",
    ):
        assert name in named
    assert "hinge_torque_sweep_right_nm" in named
    assert document_name("stamp") == "stamp"


@pytest.mark.parametrize(
    ("names", "kind", "gravity", "pointer", "words"),
    [
        (["q", "gamma"], "rigid", 9.81, "/channels/1", "'alpha'"),
        (["q", "q"], "rigid", 9.81, "/channels/1", "Leave one out"),
        (["hinge_torque"], "flexible", 9.81, "/channels/0", "rigid, equivalent"),
        (["nz"], "rigid", 0.0, "/channels/0", "fx, fy, fz"),
    ],
)
def test_service_and_library_refuse_the_same(
    names: list[str], kind: str, gravity: float, pointer: str, words: str
) -> None:
    """An unknown channel is refused with those there are, at the same place by both."""
    document = simulate_document()
    document["model"], document["channels"] = {"kind": kind}, names
    document["flight"]["gravity_m_s2"] = gravity
    with pytest.raises(InvalidInput) as by_document:
        SimulateRequest.parse(document)
    flight = replace(example_flight(), gravity_m_s2=gravity)
    with pytest.raises(InvalidInput) as by_library:
        fly(example_aircraft(), flight, SMOOTH, model=kind, duration_s=0.1, channels=names)
    assert by_document.value.faults == by_library.value.faults
    assert by_library.value.pointer == pointer
    assert words in by_library.value.hint


def test_no_channels_are_no_columns() -> None:
    """An empty list is a request too; the start's tips are reported all the same."""
    found = flown("equivalent", [], duration_s=0.05)
    assert found.trajectory.extra == {}
    assert found.start_tips_z["left"] < -0.01


def test_a_channel_may_have_several_columns() -> None:
    """Parts follow the name; an empty part is the name alone."""
    found = Channel("q", lambda *_: {"": np.ones(2), "a": np.zeros(2)}).columns(*[None] * 3)  # type: ignore[list-item]
    assert list(found) == ["q", "q_a"]
