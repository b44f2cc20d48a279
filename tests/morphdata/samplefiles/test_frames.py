"""Attitude as quaternions and in other axes: the same flight, by scipy's rotations, in every form."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from morphcore import load_trajectory
from morphcore.simulate.trajectory import Trajectory
from morphdata.faults import InvalidInput
from morphdata.samplefiles.declared import declared
from morphdata.samplefiles.frames import EULER, Frames, channel_in_here, euler_in_ned, euler_of_quaternions
from morphdata.samples import InlineSample, load_sample
from tests.morphdata.samplefiles.test_drive_columns import WRITERS, T

ROWS = len(T)
# axes of MorphID by those of others: rows are north, east, down, and forward, right, down
AXES = {
    "NED": np.eye(3),
    "ENU": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
    "FRD": np.eye(3),
    "FLU": np.diag([1.0, -1.0, -1.0]),
}
PAIRS = [("NED", "FRD"), ("NED", "FLU"), ("ENU", "FRD"), ("ENU", "FLU")]
# a turn through north with bank and pitch, as FRD to NED
FLOWN = np.stack([0.3 * np.sin(9.0 * T), 0.06 + 0.2 * T, 3.0 + 2.0 * T], axis=1)
RATES_FRD = np.stack([0.1 + T, 0.2 - T, 0.3 * T], axis=1)
VELOCITY_NED = np.stack([50.0 + T, 3.0 * T, -T], axis=1)


def rotation(euler: Any) -> Any:
    """From body to earth, of roll, pitch, yaw in rows."""
    return Rotation.from_euler("ZYX", np.asarray(euler)[:, ::-1])


def angles_of(turned: Any) -> Any:
    """Yaw, pitch and roll without jumps, a row each."""
    return np.unwrap(turned.as_euler("ZYX"), axis=0).T


def in_axes(earth: str, body: str) -> tuple[Any, dict[str, Any]]:
    """The flight's rotations, and its rates, forces and velocities, as somebody else writes them."""
    turned = Rotation.from_matrix(AXES[earth].T @ rotation(FLOWN).as_matrix() @ AXES[body])
    p, q, r = (RATES_FRD @ AXES[body]).T
    vx, vy, vz = (VELOCITY_NED @ AXES[earth]).T
    return turned, {"p": p, "q": q, "r": r, "vx": vx, "vy": vy, "vz": vz}


def require_flown(found: Trajectory) -> None:
    """The flight came out, to rounding, with a heading that does not jump."""
    np.testing.assert_allclose(rotation(found.euler).as_matrix(), rotation(FLOWN).as_matrix(), atol=1e-13)
    assert np.abs(np.diff(found.euler, axis=0)).max() < 0.5
    for names, values in (("p q r", RATES_FRD), ("vx vy vz", VELOCITY_NED)):
        measured = np.stack([found.channels[name] for name in names.split()], axis=1)
        np.testing.assert_allclose(measured, values, atol=1e-13)


@pytest.mark.parametrize(("earth", "body"), PAIRS)
@pytest.mark.parametrize("kind", WRITERS)
def test_files_in_other_axes_are_the_same_flight(tmp_path: Path, kind: str, earth: Any, body: Any) -> None:
    """Euler angles, a named and a numbered quaternion, by declaration; and as a document."""
    turned, channels = in_axes(earth, body)
    scalar_last, scalar_first = turned.as_quat().T, turned.as_quat(scalar_first=True).T
    forms: list[dict[str, Any]] = [
        dict(zip(("psi", "theta", "phi"), angles_of(turned), strict=True)),
        dict(zip(("qx", "qy", "qz", "qw"), scalar_last, strict=True)),
        dict(zip(("q[0]", "q[1]", "q[2]", "q[3]"), scalar_first, strict=True)),
    ]
    for number, attitude in enumerate(forms):
        if kind == "mat" and "q[0]" in attitude:  # no name of a variable
            attitude = {name.replace("[", "").replace("]", ""): q for name, q in attitude.items()}  # noqa: PLW2901
        path = tmp_path / f"flight.{kind}"
        columns = {name: list(map(float, values)) for name, values in {**attitude, **channels}.items()}
        WRITERS[kind](path, {"t": T, "sweep": T, **columns})
        order: Any = "wxyz" if number == 2 else None
        require_flown(load_trajectory(path, earth=earth.lower(), body=body, quaternion=order))
        said = declared(earth, body, order)
        require_flown(Trajectory.of(load_sample(path, declared=said)))


@pytest.mark.parametrize(("earth", "body"), PAIRS)
def test_samples_inline_declare_their_axes(tmp_path: Path, earth: str, body: str) -> None:
    """Angles or a quaternion; written out again nothing is left to turn; a JSON file says the same."""
    turned, channels = in_axes(earth, body)
    units = {name: "m_s" if name.startswith("v") else "rad_s" for name in channels}
    shared: dict[str, Any] = {
        "name": "a",
        "time_s": T,
        "sweep_rad": T,
        "frames": {"earth": earth, "body": body},
    }
    shared |= {f"{name}_{units[name]}": values for name, values in channels.items()}
    angles = dict(zip(("psi_rad", "theta_rad", "phi_rad"), angles_of(turned), strict=True))
    for attitude in (angles, dict(zip(("qx", "qy", "qz", "qw"), turned.as_quat().T, strict=True))):
        sample = InlineSample.parse({**shared, **attitude})
        require_flown(Trajectory.of(sample))
        assert sample.frames is None
        assert InlineSample.parse(sample.model_dump(exclude_none=True)) == sample
        document = {name: value.tolist() if hasattr(value, "tolist") else value
                    for name, value in {**shared, **attitude}.items()}  # fmt: skip
        (tmp_path / "a.json").write_text(json.dumps(document))
        require_flown(load_trajectory(tmp_path / "a.json"))


@pytest.mark.parametrize(
    "frames", ["ENU", {"earth": "NWU"}, {"earth": 5}, {"up": 1}, [], {"quaternion": "wxyz"}]
)
def test_odd_frames_in_a_json_file_are_refused(tmp_path: Path, frames: Any) -> None:
    """They are never passed over: angles in unknown axes are no attitude."""
    columns = {"t": T.tolist(), "sweep": T.tolist(), **dict.fromkeys(EULER, [0.0] * ROWS)}
    (tmp_path / "a.json").write_text(json.dumps({**columns, "frames": frames}))
    with pytest.raises(InvalidInput, match="frames cannot be read") as caught:
        load_trajectory(tmp_path / "a.json")
    assert "ENU" in caught.value.hint


def test_the_axes_of_here_change_no_digit(tmp_path: Path) -> None:
    """Angles without a declaration, or with that of NED and FRD, are read as they are written."""
    WRITERS["csv"](tmp_path / "a.csv", {"t": T, "sweep": T, **dict(zip(EULER, FLOWN.T, strict=True))})
    for found in (load_trajectory(tmp_path / "a.csv"), load_trajectory(tmp_path / "a.csv", earth="ned")):
        np.testing.assert_array_equal(found.euler, FLOWN)


@pytest.mark.parametrize(("earth", "body"), PAIRS)
def test_level_flight_east_in_each_axes(earth: Any, body: Any) -> None:
    """By hand: heading 90 degrees, 10 degrees of climb and of right bank."""
    phi, theta, psi = np.radians([10.0, 10.0, 90.0])
    given = {("NED", "FRD"): (phi, theta, psi), ("ENU", "FLU"): (phi, -theta, 0.0)}.get((earth, body))
    if given is None:  # upside down against each other: half a roll more
        given = {"NED": (phi + np.pi, theta, psi), "ENU": (phi + np.pi, -theta, 0.0)}[earth]
    found = [column[0] for column in euler_in_ned([given], Frames(earth, body))]
    np.testing.assert_allclose(
        rotation([found]).as_matrix(), rotation([(phi, theta, psi)]).as_matrix(), atol=1e-15
    )


def test_load_factor_up_is_up_in_both() -> None:
    """nz is one in level flight whichever way the third axis points; forces and deflections turn."""
    flu = Frames(body="FLU")
    signs = [channel_in_here(name, flu)[1] for name in ["nx", "ny", "nz", "fx", "fy", "fz", "p", "q", "r"]]
    assert signs == [1, -1, 1, 1, -1, -1, 1, -1, -1]
    assert channel_in_here("tip_z_left_wing", flu) == ("tip_z_left_wing", -1.0)
    assert channel_in_here("alpha", flu) == ("alpha", 1.0)
    assert channel_in_here("z", Frames(earth="ENU")) == ("z", -1.0)


def test_random_rotations_come_back() -> None:
    """Quaternions of either sign and of every attitude."""
    found = Rotation.random(500, random_state=3)
    signs = np.where(np.arange(500) % 2, 1.0, -1.0)[:, None]
    euler = np.array(euler_of_quaternions(signs * found.as_quat(scalar_first=True))).T
    np.testing.assert_allclose(rotation(euler).as_matrix(), found.as_matrix(), atol=1e-13)


QUATERNION = dict(zip(("qw", "qx", "qy", "qz"), rotation(FLOWN).as_quat(scalar_first=True).T, strict=True))


@pytest.mark.parametrize(
    ("columns", "said", "hint"),
    [
        ({f"q{n}": q for n, q in enumerate(QUATERNION.values())}, "no column phi, theta, psi", "wxyz"),
        ({**QUATERNION, "qx": 0.5 + 0.0 * T}, "row 0|line 2", "squares"),
        ({"qw": QUATERNION["qw"], "qx": QUATERNION["qx"]}, "no column phi, theta, psi", "theta_deg"),
    ],
)  # fmt: skip
def test_what_is_no_attitude_is_refused(
    written: Callable[..., Path], columns: dict[str, Any], said: str, hint: str
) -> None:
    """An order that nobody knows, a quaternion of another length than one, one of two columns."""
    with pytest.raises(InvalidInput, match=said) as caught:
        load_trajectory(written(columns))
    assert hint in caught.value.hint


def test_degrees_are_noticed_before_they_are_turned(written: Callable[..., Path]) -> None:
    """Pitch beyond a right angle is none in any axes."""
    path = written(dict(zip(EULER, np.degrees(FLOWN).T, strict=True)))
    with pytest.raises(InvalidInput, match="beyond pi/2"):
        load_trajectory(path, earth="ENU", body="FLU")


@pytest.fixture(params=WRITERS)
def written(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[..., Path]:
    """Writes a flight that sweeps, with these columns, in each format."""

    def write(columns: dict[str, Any]) -> Path:
        path = tmp_path / f"flight.{request.param}"
        WRITERS[request.param](path, {"t": T, "sweep": T, **columns})
        return path

    return write


def test_columns_are_renamed_and_scaled(written: Callable[..., Path]) -> None:
    """A servo's counts become degrees, a pitch column of another name the pitch; the file's own give way."""
    angles = {"ROLL": FLOWN[:, 0], "PITCH": np.degrees(FLOWN[:, 1]), "psi": FLOWN[:, 2], "phi": 9.0 + T}
    path = written({**angles, "servo": 1500.0 + 400.0 * T, "gyro": 10.0 * T})
    columns = {"phi": "roll", "theta_deg": "PITCH", "fold_left_deg": "servo*0.09-135", "q_deg_s": "gyro*-2"}
    found = load_trajectory(path, columns=columns)
    np.testing.assert_allclose(found.euler, FLOWN, rtol=1e-14)
    np.testing.assert_allclose(found.drives["fold_left"], np.deg2rad(36.0 * T), atol=1e-14)
    np.testing.assert_allclose(found.channels["q"], np.deg2rad(-20.0 * T), atol=1e-14)


def test_a_declared_column_is_needed(written: Callable[..., Path]) -> None:
    """What was declared and is not there is said, with what is."""
    path = written(dict(zip(EULER, FLOWN.T, strict=True)))
    with pytest.raises(InvalidInput, match="no column 'servo_1'") as caught:
        load_trajectory(path, columns={"fold_left": "servo_1"})
    assert "theta" in caught.value.hint


@pytest.mark.parametrize(
    ("words", "pointer"),
    [
        ({"earth": "NWU"}, "/earth"),
        ({"body": "x"}, "/body"),
        ({"quaternion": "xyz"}, "/quaternion"),
        ({"columns": {"2nd": "a"}}, "/columns/2nd"),
        ({"columns": {"theta": "a", "theta_deg": "b"}}, "/columns"),
        ({"columns": {"theta": ""}}, "/columns/theta"),
    ],
)
def test_odd_declarations_are_refused(words: Any, pointer: str) -> None:
    """By their name."""
    with pytest.raises(InvalidInput) as caught:
        declared(**words)
    assert caught.value.pointer == pointer
    assert caught.value.hint


INLINE: dict[str, Any] = {"name": "a", "time_s": T.tolist(), "sweep_rad": T.tolist()}
INLINE_Q = {name: values.tolist() for name, values in QUATERNION.items()}
ANGLES = {"phi_rad": T.tolist(), "psi_rad": T.tolist()}
FLU = {"earth": "ENU", "body": "FLU"}


@pytest.mark.parametrize(
    ("columns", "pointer"),
    [
        ({"qw": INLINE_Q["qw"], "qx": INLINE_Q["qx"]}, "/qy"),
        ({**INLINE_Q, "qz": INLINE_Q["qz"][1:]}, "/qz"),
        ({**INLINE_Q, "qz": [None, *INLINE_Q["qz"][1:]]}, "/qz"),
        ({**INLINE_Q, "qz": 5.0}, "/qz"),
        ({**INLINE_Q, "theta_rad": T.tolist()}, "/theta_rad"),
        ({name: [1.0] * ROWS for name in INLINE_Q}, "/qw/0"),
        ({**ANGLES, "frames": FLU}, "/theta_rad"),
        (
            {"phi_rad": T.tolist(), "psi_rad": T.tolist(), "theta_rad": [3.0] * ROWS, "frames": FLU},
            "/theta_rad/0",
        ),
        ({**INLINE_Q, "frames": {"earth": "NWU"}}, "/frames/earth"),
        ({**INLINE_Q, "frames": "ENU"}, "/frames"),
        ({**INLINE_Q, "frames": FLU, "p_rad_s": [True] * ROWS}, "/p_rad_s/0"),
        ({**INLINE_Q, "frames": FLU, "p_rad_s": [1.0] * ROWS, "p_deg_s": [1.0] * ROWS}, "/p_rad_s"),
    ],
)
def test_odd_attitudes_inline_are_refused(columns: Any, pointer: str) -> None:
    """At the field and, where there is one, the row."""
    with pytest.raises(InvalidInput) as caught:
        InlineSample.parse({**INLINE, **columns})
    assert pointer in [fault.pointer for fault in caught.value.faults]
