"""Columns of measured channels in files: names, units and gaps, in every format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from morphcore import load_trajectory
from morphcore.simulate.flight import write_trajectory_csv
from morphcore.simulate.trajectory import Trajectory
from morphdata.samplefiles.channel_titles import channel_meant
from morphdata.samplefiles.reading import read_flight
from morphdata.samples import InlineSample, load_sample
from tests.morphdata.samplefiles.test_drive_columns import ATTITUDE, WRITERS, T, as_csv

RATE = np.sin(T)
GAPPED = [None if row in (0, 7) else float(value) for row, value in enumerate(RATE)]


@pytest.fixture(params=WRITERS)
def written(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[..., Path]:
    """Writes a flight that sweeps, with these columns, in each format."""

    def write(columns: dict[str, Any]) -> Path:
        path = tmp_path / f"flight.{request.param}"
        WRITERS[request.param](path, {**ATTITUDE, "sweep": T, **columns})
        return path

    return write


def test_channels_are_read_in_si_units(written: Callable[..., Path]) -> None:
    """Rates in degrees, lengths in mm, speeds in knots; no channel is taken for a drive."""
    titles = {"q_deg_s": ("q", np.pi / 180), "tip_right_z_mm": ("tip_right_z", 1e-3), "nz": ("nz", 1.0),
              "airspeed_kt": ("airspeed", 1852 / 3600), "fz_g": ("fz", 9.80665),
              "tip_z_left_wing": ("tip_z_left_wing", 1.0)}  # fmt: skip
    path = written(dict.fromkeys(titles, RATE + 2.0))
    for channels in (load_trajectory(path).channels, Trajectory.of(load_sample(path)).channels):
        assert set(channels) == {name for name, _ in titles.values()}
        for name, factor in titles.values():
            np.testing.assert_allclose(channels[name], factor * (RATE + 2.0), rtol=1e-14)
    assert list(read_flight(path).drives) == ["sweep"]


def test_a_missing_value_is_a_gap(written: Callable[..., Path]) -> None:
    """NaN in the library, null in a document, and no fault; other further columns stay as they were."""
    path = written({"p": GAPPED, "note": GAPPED})
    flown = load_trajectory(path)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(flown.channels["p"])), [0, 7])
    assert set(flown.extra) == {"sweep"}
    sample = load_sample(path)
    assert sample.channels["p"] == GAPPED
    again = Trajectory.of(InlineSample.parse(sample.model_dump(exclude_none=True)))
    np.testing.assert_array_equal(again.channels["p"], flown.channels["p"])


def test_channels_survive_writing(written: Callable[..., Path], tmp_path: Path) -> None:
    """Written and read again: the same gaps, and nine digits."""
    flown = load_trajectory(written({"p_deg_s": GAPPED, "nz": RATE}))
    write_trajectory_csv(flown, tmp_path / "again.csv")
    again = load_trajectory(tmp_path / "again.csv")
    assert list(again.channels) == ["p", "nz"]
    for name, values in flown.channels.items():
        np.testing.assert_allclose(again.channels[name], values, rtol=1e-8)


@pytest.mark.parametrize(
    ("columns", "name", "said"),
    [
        ({"p": RATE, "p_deg_s": RATE}, "p", "both give p"),
        ({"p": [np.inf, *RATE[1:]]}, "p", "p is "),
        ({"p": [None] * 20}, "p", "p holds no value"),
        ({"q [rpm]": RATE}, "q", "the unit of 'q [rpm]' is not read"),
    ],
)
def test_what_cannot_be_used_is_said_and_spoils_no_flight(
    tmp_path: Path, columns: dict[str, Any], name: str, said: str
) -> None:
    """The flight is read, its other channels too; why one is missing is kept by its name."""
    path = tmp_path / "flight.csv"
    as_csv(path, {**ATTITUDE, "sweep": T, "nz": RATE, **columns})
    flown = load_trajectory(path)
    assert set(flown.channels) == {"nz"}
    assert said in flown.unreadable[name]
    assert load_sample(path, drives=None).channels.keys() == {"nz"}


def test_a_row_of_units_counts_for_channels(tmp_path: Path) -> None:
    """As it does for angles; a unit that does not belong to the channel is named."""
    path = tmp_path / "flight.csv"
    rows = "".join(f"{t},0,0,0,{t},{t},{t},x\n" for t in T)
    path.write_text(f"t,phi,theta,psi,sweep,q,tip_left_z,nz\ns,deg,deg,deg,deg,deg/s,kg,-\n{rows}")
    flown = load_trajectory(path)
    np.testing.assert_allclose(flown.channels["q"], np.deg2rad(T), rtol=1e-14)
    assert set(flown.channels) == {"q"}
    assert "the unit 'kg' of tip_left_z" in flown.unreadable["tip_left_z"]
    assert "nz is 'x', not a finite number (line 3)" in flown.unreadable["nz"]


@pytest.mark.parametrize(
    ("title", "meant"),
    [
        ("Q [deg/s]", ("q", np.pi / 180)),
        ("p (°/s)", ("p", np.pi / 180)),
        ("alpha_deg", ("alpha", np.pi / 180)),
        ("nz [g]", ("nz", 1.0)),
        ("fz [m/s²]", ("fz", 1.0)),
        ("hinge_torque_fold_left [N m]", ("hinge_torque_fold_left", 1.0)),
        ("tip_z_right_wing_cm", ("tip_z_right_wing", 1e-2)),
        ("tip_z_fin_cm", ("tip_z_fin", 1e-2)),  # no "in cm" of the surface f
        ("root_bending_fin [kN m]", ("root_bending_fin", 1e3)),
        ("section_lift_fin_1_n_m", ("section_lift_fin_1", 1.0)),
        ("section_cl_fin_1", ("section_cl_fin_1", None)),
        ("nz_imu1", ("nz_imu1", None)),
        ("q", ("q", None)),
        ("q0", None),
        ("q [m]", None),
        ("temp_s", None),
        ("fold_left_deg", None),
        ("theta_deg", None),
    ],
)
def test_titles_of_channels(title: str, meant: tuple[str, float | None] | None) -> None:
    """The unit is one of the channel's kind."""
    assert channel_meant(title) == meant
