"""Samples as documents: columns of drives, and what an aircraft makes of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from morphdata.drives import Drive
from morphdata.faults import InvalidInput
from morphdata.identify import EXAMPLE_REQUEST, IdentifyRequest
from morphdata.operations.identify import cost
from morphdata.samples import EXAMPLE_FOLD, EXAMPLE_SAMPLE, InlineSample
from tests.morphdata.samplefiles.test_drive_columns import drives
from tests.morphdata.test_schedules import aircraft

Document = dict[str, Any]
STILL, MOVED = [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.01, 0.03]
BARE = {name: values for name, values in EXAMPLE_SAMPLE.items() if not name.startswith("sweep")}


def faults(of: dict[str, Drive], **columns: Any) -> list[tuple[str, str]]:
    """Code and pointer of what is wrong with columns for an aircraft."""
    return [(f.code, f.pointer) for f in InlineSample.parse({**BARE, **columns}).drive_faults(of)]


def refusal(**columns: Any) -> tuple[str, str, str]:
    """Code, pointer and hint of the first fault of a sample by itself."""
    with pytest.raises(InvalidInput) as caught:
        InlineSample.parse({**BARE, **columns})
    fault = caught.value.faults[0]
    return fault.code, fault.pointer, fault.hint


def test_columns_are_drives_and_words_in_rad_and_degrees() -> None:
    """By their keys, in rad; written out and read again it is the same sample."""
    sample = InlineSample.parse(EXAMPLE_FOLD)
    assert list(sample.drives) == ["sweep", "fold_left"]
    np.testing.assert_allclose(sample.drives["fold_left"], np.deg2rad([0.0, 0.0, 0.1, 0.3]))
    assert InlineSample.parse(sample.model_dump(exclude_none=True)) == sample


def test_a_simulated_trajectory_is_a_sample() -> None:
    """Its channels are no drives."""
    sample = InlineSample.parse(
        {**EXAMPLE_SAMPLE, "p_rad_s": MOVED, "alpha_rad": MOVED, "nz": MOVED, "tip_z_left_wing_m": MOVED}
    )
    assert list(sample.drives) == ["sweep_left", "sweep_right"]


@pytest.mark.parametrize(
    ("columns", "code", "pointer", "hint"),
    [
        ({"sweep_left": MOVED}, "unknown_field", "/sweep_left", "sweep_left_rad"),
        ({"fold_left_mrad": MOVED}, "unknown_field", "/fold_left_mrad", "leave it out"),
        ({"thetas_rad": [0.0]}, "unknown_field", "/thetas_rad", "theta_rad"),
        ({"both_rad": MOVED}, "unknown_field", "/both_rad", "it out"),
        ({"fold_rad": MOVED, "fold_deg": MOVED}, "given_twice", "/fold_rad", "one of them"),
        ({"fold_rad": MOVED[:3]}, "unequal_lengths", "/fold_rad", "fold_rad"),
        ({"fold_rad": [0.0, 0.0, "x", 0.0]}, "float_type", "/fold_rad/2", "number"),
        (
            {"fold_left_rad": [0.0, 0.0, 2000.0, 0.0]},
            "looks_like_degrees",
            "/fold_left_rad/2",
            "fold_left_deg",
        ),
    ],
)
def test_what_is_no_column_of_a_drive_is_refused(columns: Any, code: str, pointer: str, hint: str) -> None:
    """Without an aircraft: by the form of names and values."""
    found = refusal(**columns)
    assert found[:2] == (code, pointer)
    assert hint in found[2]


TWICE = [("ambiguous_drive", "/sweep_left_rad"), ("ambiguous_drive", "/sweep_right_rad")]


@pytest.mark.parametrize(
    ("axes", "columns", "found"),
    [
        ("z", {"sweep_left_rad": MOVED, "sweep_right_rad": MOVED}, []),
        ("x", {"sweep_left_rad": MOVED, "sweep_right_rad": MOVED}, []),
        ("zx", {"sweep_left_rad": MOVED, "sweep_right_rad": MOVED}, []),
        ("zx", {"sweep_rad": MOVED, "fold_left_deg": MOVED, "fold_right_rad": MOVED}, []),
        ("xy", {"sweep_left_rad": MOVED, "sweep_right_rad": MOVED}, TWICE),
        ("z", {"sweep_rad": MOVED, "fold_rad": MOVED}, [("unknown_drive", "/fold_rad")]),
        ("z", {"sweep_left_rad": MOVED}, [("missing", "/sweep_right_rad")]),
        ("x", {"sweep_left_rad": MOVED}, [("missing", "/sweep_right_rad")]),
        ("zx", {"sweep_rad": MOVED, "fold_right_rad": MOVED}, [("missing", "/fold_left_rad")]),
        ("z", {}, [("no_drive", "")]),
        ("z", {"sweep_left_rad": MOVED, "sweep_rad": MOVED}, [("given_twice", "/sweep_rad")]),
        ("z", {"sweep_deg": [0.0, 0.0, 74.0, 80.0]}, [("sweep_out_of_range", "/sweep_deg/3")]),
        ("x", {"fold_rad": [0.0, 0.0, -1.4, 0.0]}, [("angle_out_of_range", "/fold_rad/2")]),
    ],
)  # fmt: skip
def test_an_aircraft_knows_its_columns(axes: str, columns: Document, found: list[tuple[str, str]]) -> None:
    """Names, sides and ranges; what is not measured at all holds its angle."""
    assert faults(drives(*axes), **columns) == found


def test_refusals_name_the_drives() -> None:
    """Each hint holds the names to use."""
    folding = drives("x")
    for columns in ({}, {"flod_left_rad": MOVED, "fold_right_rad": MOVED}):
        (fault, *_) = InlineSample.parse({**BARE, **columns}).drive_faults(folding)
        assert "fold_right, fold_left (or fold for both sides)" in fault.hint
    assert "Did you mean 'fold_left'?" in fault.hint


def test_a_wing_on_one_side_alone_needs_no_other_column() -> None:
    """The aircraft says which sides there are."""
    assert faults(drives("x", sides=("left",)), fold_left_rad=MOVED) == []


def test_a_request_points_to_the_column() -> None:
    """Of the second sample."""
    request = {**EXAMPLE_REQUEST, "aircraft": aircraft("z", "x")}
    samples = [EXAMPLE_SAMPLE, {**BARE, "name": "other", "sweep_rad": MOVED, "fold_right_rad": MOVED}]
    with pytest.raises(InvalidInput) as caught:
        IdentifyRequest.parse({**request, "samples": samples})
    assert [fault.pointer for fault in caught.value.faults] == ["/samples/1/fold_left_rad"]
    assert caught.value.hint


def test_a_fold_on_one_side_is_an_asymmetric_sample() -> None:
    """It determines the drag, so one unknown more is expected; a mirrored pair of wings is one."""
    document = aircraft("z", "x")
    both, one = (
        cost(
            IdentifyRequest.parse(
                {
                    **EXAMPLE_REQUEST,
                    "aircraft": document,
                    "samples": [
                        {**BARE, "sweep_rad": MOVED, "fold_left_rad": MOVED, "fold_right_rad": right}
                    ],
                }
            )
        ).parameters
        for right in (MOVED, STILL)
    )
    assert one == both + 1
    vectors = [{**wing, "hinges": None, "hinge": {**wing["hinges"][0], "axis": [0, 0, sign], "name": "sweep"}}
               for wing, sign in zip(document["surfaces"], (1, -1), strict=True)]  # fmt: skip
    pair = {**EXAMPLE_REQUEST, "aircraft": {**document, "surfaces": vectors}}
    assert (
        cost(IdentifyRequest.parse(pair)).parameters
        == cost(IdentifyRequest.parse(EXAMPLE_REQUEST)).parameters
    )


def test_channels_are_kept_in_si_units_with_gaps() -> None:
    """Degrees are converted, null is a gap, and a document written out is the same sample again."""
    gapped = [None, 0.0, 1.0, 2.0]
    sample = InlineSample.parse({**EXAMPLE_SAMPLE, "p_rad_s": gapped, "q_deg_s": gapped, "alpha_deg": MOVED})
    assert sample.channels["p"] == gapped
    assert sample.channels["q"][0] is None
    np.testing.assert_allclose(sample.channels["q"][1:], np.deg2rad(gapped[1:]))
    assert list(sample.drives) == ["sweep_left", "sweep_right"]
    assert InlineSample.parse(sample.model_dump(exclude_none=True)) == sample


@pytest.mark.parametrize(
    ("columns", "code", "pointer"),
    [
        ({"p_rad_s": MOVED[:3]}, "unequal_lengths", "/p_rad_s"),
        ({"p_rad_s": [None] * 4}, "no_values", "/p_rad_s"),
        ({"p_rad_s": MOVED, "p_deg_s": MOVED}, "given_twice", "/p_rad_s"),
        ({"p_rad_s": [0.0, 0.0, "x", 0.0]}, "float_type", "/p_rad_s/2"),
        ({"fold_rad": [0.0, None, 0.0, 0.0]}, "float_type", "/fold_rad/1"),
        ({"theta_rad": [0.0, None, 0.0, 0.0]}, "float_type", "/theta_rad/1"),
        ({"p_mrad_s": MOVED}, "unknown_field", "/p_mrad_s"),
    ],
)
def test_what_is_no_channel_is_refused(columns: Any, code: str, pointer: str) -> None:
    """By name and row; a gap in a drive or an angle, too."""
    assert refusal(**columns)[:2] == (code, pointer)
