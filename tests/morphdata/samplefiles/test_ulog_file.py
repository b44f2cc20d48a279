"""Logs of PX4 as sample flights: attitude, channels, declared drives, rates that differ, broken files."""

from __future__ import annotations

import builtins
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from morphcore import load_trajectory
from morphcore.errors import InvalidInput
from tests.morphdata.samplefiles.ulog import HEADER, SYNC, definition, message, subscription, ulog

START_US = 37_000_000
TIMES_US = START_US + 10_000 * np.arange(200)  # 100 Hz, two seconds
T = 0.01 * np.arange(200)
EULER = np.stack([0.2 * np.sin(3 * T), 0.06 + 0.1 * T, 0.4 * T], axis=1)
DRIVE = {"sweep_left_deg": "actuator_outputs.output[0]*0.09-135"}


ATTITUDE = "vehicle_attitude"
ENDLESS = HEADER + definition(ATTITUDE, [f"{ATTITUDE} a"]) + subscription(0, ATTITUDE, 0)


def log(**changes: Any) -> bytes:
    """A flight: attitude at 100 Hz, rates at 250 Hz and earlier, servos at 50 Hz."""
    rotation = Rotation.from_euler("ZYX", EULER[:, ::-1])
    fast_us = START_US - 20_000 + 4_000 * np.arange(520)
    slow_us = START_US + 20_000 * np.arange(101)
    topics: dict[str, Any] = {
        "vehicle_attitude": {
            "uint64_t timestamp": TIMES_US + 300,
            "uint64_t timestamp_sample": TIMES_US,
            "float[4] q": rotation.as_quat(scalar_first=True),
        },
        "vehicle_angular_velocity": {
            "uint64_t timestamp": fast_us,
            "float[3] xyz": np.stack([1e-6 * (fast_us - START_US)] * 3, axis=1) * [1.0, 2.0, 3.0],
        },
        "airspeed_validated": {
            "uint64_t timestamp": slow_us,
            "float true_airspeed_m_s": 50.0 + 1e-6 * (slow_us - START_US),
        },
        "actuator_outputs": {
            "uint64_t timestamp": slow_us,
            "float[2] output": np.stack([1500.0 + 2e-4 * (slow_us - START_US)] * 2, axis=1),
        },
        "actuator_outputs#1": {
            "uint64_t timestamp": slow_us,
            "float[2] output": np.stack([0.1 + 1e-7 * (slow_us - START_US)] * 2, axis=1),
        },
    }
    return ulog({name: item for name, item in (topics | changes).items() if item is not None})


def read(path: Path, content: bytes, **declared: Any) -> Any:
    """The flight in a log."""
    path = path / "flight.ulg"
    path.write_bytes(content)
    return load_trajectory(path, **{"columns": DRIVE, **declared})


def test_a_log_is_a_flight(tmp_path: Path) -> None:
    """Attitude at its own times of measurement, all else interpolated onto them, to single precision."""
    found = read(tmp_path, log(), columns={**DRIVE, "sweep_right": "actuator_outputs_1.output[1]"})
    np.testing.assert_allclose(found.time_s, T, atol=1e-12)
    np.testing.assert_allclose(found.euler, EULER, atol=1e-6)
    np.testing.assert_allclose(found.drives["sweep_left"], np.deg2rad(0.09 * 200.0 * T), atol=1e-6)
    np.testing.assert_allclose(found.drives["sweep_right"], 0.1 + 0.1 * T, atol=1e-6)
    for name, factor in {"p": 1.0, "q": 2.0, "r": 3.0}.items():
        np.testing.assert_allclose(found.channels[name], factor * T, atol=1e-6)
    np.testing.assert_allclose(found.channels["airspeed"], 50.0 + T, atol=1e-5)
    assert set(found.channels) == {"p", "q", "r", "airspeed"}


def test_nothing_is_invented_outside_a_stream_and_in_its_holes(tmp_path: Path) -> None:
    """A channel has gaps there; the flight ends where a drive does."""
    times_us = START_US + 4_000 * np.concatenate(
        [np.arange(100), np.arange(300, 400)]
    )  # without 0.4 to 1.2 s
    rates = {"uint64_t timestamp": times_us, "float[3] xyz": np.zeros((200, 3))}
    servo_us = START_US + 300_000 + 20_000 * np.arange(61)
    servo = {"uint64_t timestamp": servo_us, "float[2] output": np.full((61, 2), 1500.0)}
    found = read(tmp_path, log(vehicle_angular_velocity=rates, actuator_outputs=servo))
    np.testing.assert_allclose(found.time_s[[0, -1]], [0.3, 1.5], atol=1e-9)
    lost = (found.time_s > 0.397) & (found.time_s < 1.199)
    np.testing.assert_array_equal(np.isnan(found.channels["p"]), lost)


def test_a_window_is_cut_out(tmp_path: Path) -> None:
    """Times stay those since the first attitude of the log."""
    found = read(tmp_path, log(), between=(0.5, 1.0))
    np.testing.assert_allclose(found.time_s[[0, -1]], [0.5, 1.0], atol=1e-9)
    np.testing.assert_allclose(found.euler, EULER[50:101], atol=1e-6)


@pytest.mark.parametrize(
    ("content", "declared", "said", "hint"),
    [
        (log(), {"columns": None}, "no field of the log is declared", "knows actuator_outputs"),
        (log(), {"columns": {"sweep": "servo.angle"}}, "no 'servo.angle'", "actuator_outputs"),
        (log(), {"columns": {"sweep": "actuator_outputs.output[7]"}}, "no 'actuator_outputs.out", "TOPIC"),
        (log(), {"earth": "ENU"}, "NED and FRD", "no other"),
        (log(), {"between": (50.0, 60.0)}, "no time in common", "window"),
        (log(vehicle_attitude=None), {}, "no vehicle_attitude", "Hz"),
        (b"", {}, "not a ULog", "PX4"),
        (b"text", {}, "not a ULog", "PX4"),
        (HEADER[:12], {}, "not a readable ULog", "again"),
        (HEADER, {}, "no vehicle_attitude", "Hz"),
        (HEADER + message("B", b"\0" * 8 + b"\xff" * 8 + bytes(24)), {}, "not a readable ULog", "again"),
        (ENDLESS, {}, "not a readable ULog", "again"),
        (HEADER + b"\xff" * 4000, {}, "no vehicle_attitude", "Hz"),
    ],
)  # fmt: skip
def test_other_logs_are_refused(tmp_path: Path, content: bytes, declared: Any, said: str, hint: str) -> None:
    """What lacks, by name; broken, foreign and self-referring files."""
    with pytest.raises(InvalidInput, match=said) as caught:
        read(tmp_path, content, **declared)
    assert hint in caught.value.hint


def test_reading_goes_on_behind_a_damage(tmp_path: Path) -> None:
    """At the next mark for that; what lies between is lost, the rest is whole."""
    whole, mark = log(), message("S", SYNC)
    middle = whole.index(b"\x22\x00D", len(whole) // 2)  # a row of attitude
    found = read(tmp_path, whole[:middle] + b"\xff" * 500 + mark + whole[middle:])
    np.testing.assert_allclose(found.euler, EULER, atol=1e-6)
    found = read(tmp_path, whole[:middle] + b"\xff" * 500 + whole[middle:])
    assert 50 < len(found.time_s) < 150


def test_appended_data_follow_a_cut_message(tmp_path: Path) -> None:
    """The flags say where; the flight is the same."""
    whole = log()
    middle = whole.index(b"\x22\x00D", len(whole) // 2)
    flags = bytes(8) + bytes([1]) + bytes(7) + struct.pack("<3Q", middle + 20, 0, 0)
    cut = whole[middle : middle + 20]
    content = HEADER + message("B", flags) + whole[len(HEADER) + 43 : middle] + cut + whole[middle:]
    np.testing.assert_allclose(read(tmp_path, content).euler, EULER, atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_a_cut_or_spoilt_log_never_breaks_the_reader(tmp_path: Path, seed: int) -> None:
    """It is a flight of fewer rows, or refused."""
    random, content = np.random.default_rng(seed), bytearray(log())
    for at in random.integers(16, len(content), 20):
        content[at] = random.integers(256)
    for end in (len(content), int(random.integers(16, len(content)))):
        try:
            assert len(read(tmp_path, bytes(content[:end])).time_s) <= 200
        except InvalidInput as error:
            assert error.hint  # noqa: PT017


def test_without_its_reader_the_extra_is_named(tmp_path: Path, monkeypatch: Any) -> None:
    """Which extra to install."""
    real = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name.startswith("pyulog"):
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InvalidInput, match="pyulog") as caught:
        read(tmp_path, log())
    assert "morphid[formats]" in caught.value.hint
