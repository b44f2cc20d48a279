"""Aircraft and flight documents: the examples read right, and everything else is refused at its field."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from morphcore.geometry.aircraft import Aircraft, Flight
from morphdata.aircraft import Aircraft as AircraftDocument
from morphdata.aircraft import load_aircraft
from morphdata.faults import InvalidInput, MorphError
from morphdata.flight import Flight as FlightDocument
from morphdata.flight import load_flight
from tests.models.chains import aircraft_of, flight_of

EXAMPLES = Path(__file__).parents[2] / "examples"
AIRCRAFT: dict[str, Any] = json.loads((EXAMPLES / "aircraft.json").read_text())
FLIGHT: dict[str, Any] = json.loads((EXAMPLES / "flight.json").read_text())
TAIL: dict[str, Any] = {
    "name": "tail",
    "side": "right",
    "span_m": 1.0,
    "root_chord_m": 0.3,
    "tip_chord_m": 0.2,
    "thickness_m": 0.03,
    "material": {"density_kg_m3": 500.0, "youngs_modulus_pa": 2.1e9},
    "position_m": [-2.2, 0.0, 0.0],
    "flexible": False,
}


def with_value(document: dict[str, Any], pointer: str, value: Any) -> dict[str, Any]:
    """A copy of the document with the field at a JSON pointer set (or taken out, for ``...``)."""
    changed = copy.deepcopy(document)
    *path, last = pointer.split("/")[1:]
    place: Any = changed
    for part in path:
        place = place[int(part)] if isinstance(place, list) else place[part]
    key = int(last) if isinstance(place, list) else last
    if value is ...:
        del place[key]
    else:
        place[key] = value
    return changed


def test_the_example_aircraft() -> None:
    """The reference aircraft: 5 x 0.7 x 0.5 m of density 500 kg/m^3 is 875 kg, with two mirrored wings."""
    aircraft = Aircraft.of(load_aircraft(EXAMPLES / "aircraft.json"))
    assert aircraft.fuselage.mass_kg == pytest.approx(875.0)
    expected = 875.0 / 12 * np.diag([0.7**2 + 0.5**2, 5.0**2 + 0.5**2, 5.0**2 + 0.7**2])
    np.testing.assert_allclose(aircraft.fuselage.inertia_B, expected)
    assert [s.side for s in aircraft.surfaces] == ["right", "left"]
    assert [s.position_m for s in aircraft.surfaces] == [(0.0, 0.35, 0.0), (0.0, -0.35, 0.0)]
    assert sum(surface.flexible for surface in aircraft.surfaces) == 2
    assert aircraft.surfaces[0].chord_at(1.0) == pytest.approx(0.3)


def test_the_example_flight() -> None:
    """The reference flight: 150 m/s at sea level is 13.8 kPa of dynamic pressure."""
    flight = Flight.of(load_flight(EXAMPLES / "flight.json"))
    assert flight.dynamic_pressure_pa == pytest.approx(0.5 * 1.225 * 150.0**2)
    assert flight.mach == 0.0
    assert flight.start is not None
    assert flight.start.alpha_rad == pytest.approx(0.0623, abs=1e-4)
    np.testing.assert_array_equal(flight.wind_N, 0.0)


def test_a_fuselage_given_outright() -> None:
    """Mass, inertia and centre of mass replace the box; a diagonal may be given alone."""
    outright = {"mass_kg": 10.0, "inertia_kg_m2": [1.0, 2.0, 2.5], "centre_of_mass_m": [0.1, 0.0, 0.0]}
    fuselage = aircraft_of({**AIRCRAFT, "fuselage": outright}).fuselage
    np.testing.assert_array_equal(fuselage.inertia_B, np.diag([1.0, 2.0, 2.5]))
    np.testing.assert_array_equal(fuselage.centre_of_mass_B, [0.1, 0.0, 0.0])
    full = [[1.0, 0.1, 0.2], [0.1, 2.0, 0.3], [0.2, 0.3, 2.5]]
    fuselage = aircraft_of({**AIRCRAFT, "fuselage": {**outright, "inertia_kg_m2": full}}).fuselage
    np.testing.assert_array_equal(fuselage.inertia_B, full)


def test_a_fixed_tail_is_a_surface_without_hinge() -> None:
    """New surfaces are data, not code."""
    aircraft = aircraft_of({**AIRCRAFT, "surfaces": [*AIRCRAFT["surfaces"], TAIL]})
    tail = aircraft.surfaces[2]
    assert tail.hinges == ()
    assert not tail.flexible
    assert tail.mean_chord_m == pytest.approx(0.25)
    assert sum(surface.flexible for surface in aircraft.surfaces) == 2


def test_mach_is_computed_on_request() -> None:
    """The value "auto" divides the airspeed by the standard speed of sound at that altitude."""
    flight = flight_of({**FLIGHT, "mach": "auto", "altitude_m": 11_000.0, "start": None})
    assert flight.mach == pytest.approx(150.0 / 295.070, rel=1e-5)
    assert flight.start is None


def test_density_comes_from_the_altitude_when_not_given() -> None:
    """Without a density the standard atmosphere's is taken."""
    document = with_value({**FLIGHT, "altitude_m": 5000.0}, "/air_density_kg_m3", ...)
    assert flight_of(document).air_density_kg_m3 == pytest.approx(0.736116, rel=1e-5)


def test_too_fast_for_linear_compressibility() -> None:
    """Beyond Mach 0.7 the flight is refused, not computed wrong."""
    for changes in ({"mach": 0.71}, {"mach": "auto", "airspeed_m_s": 250.0}):
        with pytest.raises(InvalidInput) as caught:
            read_flight({**FLIGHT, **changes})
        assert caught.value.pointer == "/flight/mach"


def read_aircraft(document: Any) -> AircraftDocument:
    """Read the document of an aircraft."""
    return AircraftDocument.parse(document, "/aircraft")


def read_flight(document: Any, pointer: str = "/flight") -> FlightDocument:
    """Read the document of a flight condition."""
    return FlightDocument.parse(document, pointer)


WING = "/surfaces/0"
INERTIA_ABOUT_THE_SPAN = f"{WING}/section/inertia_per_length_kg_m/1"
SECTION = {"ei_flap_n_m2": 1.0, "ei_edge_n_m2": 1.0, "gj_n_m2": 1.0, "mass_per_length_kg_m": 1.0}


@pytest.mark.parametrize(
    ("field", "value", "pointer"),
    [
        ("/name", "", None),
        ("/fuselage", ..., None),
        ("/fuselage", [1, 2], None),
        ("/fuselage/shape", "sphere", None),
        ("/fuselage/length_m", ..., None),
        ("/fuselage/length_m", -5.0, None),
        ("/fuselage/density_kg_m3", True, None),
        ("/fuselage", {"mass_kg": 1, "inertia_kg_m2": [1, -1, 1]}, "/fuselage/inertia_kg_m2"),
        ("/fuselage", {"mass_kg": 1, "inertia_kg_m2": [1, 1, 3]}, "/fuselage/inertia_kg_m2"),
        ("/fuselage", {"mass_kg": 1, "inertia_kg_m2": np.tri(3).tolist()}, "/fuselage/inertia_kg_m2"),
        ("/surfaces", [], None),
        ("/surfaces", {}, None),
        (f"{WING}/name", "left wing", "/surfaces/1/name"),
        (f"{WING}/side", "top", None),
        (f"{WING}/span_m", math.nan, None),
        (f"{WING}/span_m", math.inf, None),
        (f"{WING}/span_m", "3", None),
        (f"{WING}/span_m", 10**400, None),
        (f"{WING}/chord_m", ..., None),
        (f"{WING}/thickness_m", 0, None),
        (f"{WING}/flexible", "yes", None),
        (f"{WING}/material/poisson_ratio", 0.6, None),
        (f"{WING}/material/density_kg_m3", ..., None),
        (f"{WING}/hinge/axis", "w", None),
        (f"{WING}/hinge/axis", ["z"], None),
        (f"{WING}/hinge/min_rad", 1.3, None),
        (f"{WING}/hinge/position_m", [0.0, 0.35], None),
        (f"{WING}/hinge/position_m", ["0", "0.35", "0"], f"{WING}/hinge/position_m/0"),
        (f"{WING}/hinge/position_m", [True, False, True], f"{WING}/hinge/position_m/0"),
        (f"{WING}/hinge/position_m", [0.0, 10**400, 0.0], f"{WING}/hinge/position_m/1"),
        (f"{WING}/hinge/position_m", [0.0, None, 0.0], f"{WING}/hinge/position_m/1"),
        (f"{WING}/hinge", ..., None),
        (f"{WING}/sweep_m", 1.0, None),
        (f"{WING}/section", {"ei_flap_n_m2": 1.0}, f"{WING}/section/ei_edge_n_m2"),
        (f"{WING}/section", SECTION | {"inertia_per_length_kg_m": [1, 0, 1]}, INERTIA_ABOUT_THE_SPAN),
        (f"{WING}/elastic_axis_offset_m", 0.31, None),
        (f"{WING}/material/poisson_ratio", -0.995, None),
        (f"{WING}/chrod_m", 0.3, None),
    ],
)
def test_a_bad_aircraft_is_refused_at_its_field(field: str, value: Any, pointer: str | None) -> None:
    """The error's pointer leads to the field, and the hint says what to do."""
    with pytest.raises(InvalidInput) as caught:
        read_aircraft(with_value(AIRCRAFT, field, value))
    assert caught.value.pointer == f"/aircraft{pointer or field}"
    assert caught.value.hint


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("/airspeed_m_s", ...),
        ("/airspeed_m_s", 0.0),
        ("/air_density_kg_m3", -1.0),
        ("/altitude_m", 30_000.0),
        ("/gravity_m_s2", math.nan),
        ("/mach", "fast"),
        ("/wind_n_m_s", 3.0),
        ("/start/alpha_rad", 1.0),
        ("/start/moment_b_n_m", [0.0, 0.0]),
        ("/start/beta_rad", 0.1),
    ],
)
def test_a_bad_flight_is_refused_at_its_field(field: str, value: Any) -> None:
    """The same for the flight condition, under whatever pointer the document sits."""
    with pytest.raises(InvalidInput) as caught:
        read_flight(with_value(FLIGHT, field, value), pointer="/body/flight")
    assert caught.value.pointer == f"/body/flight{field}"
    assert caught.value.hint


def test_a_misspelt_field_is_guessed() -> None:
    """An unknown field is not ignored: the hint offers the nearest known one, the pointer is escaped."""
    with pytest.raises(InvalidInput, match="Did you mean 'airspeed_m_s'"):
        read_flight({**FLIGHT, "air_speed_m_s": 1.0})
    with pytest.raises(InvalidInput) as caught:
        read_flight({**FLIGHT, "wind/n~m": 1.0})
    assert caught.value.pointer == "/flight/wind~1n~0m"


@pytest.mark.parametrize("load", [load_aircraft, load_flight])
@pytest.mark.parametrize("text", [None, "{", "[]", "\udcff", "[" * 100_000, "1" * 10_000])
def test_unreadable_files(load: Callable[[Path], object], text: str | None, tmp_path: Path) -> None:
    """No file, no JSON, no object, no UTF-8: a sentence with the path, never a traceback of the parser."""
    path = tmp_path / "document.json"
    if text is not None:
        path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(InvalidInput, match=r"document\.json") as caught:
        load(path)
    assert caught.value.hint


def test_a_folder_is_no_document(tmp_path: Path) -> None:
    """A path that cannot be read is an error with the reason."""
    with pytest.raises(InvalidInput, match="cannot be read"):
        load_aircraft(tmp_path)


@pytest.mark.parametrize("changes", [{"airspeed_m_s": "x" * 1_000_000}, {"x" * 1_000_000: 1}])
def test_errors_stay_short(changes: dict[str, Any]) -> None:
    """A megabyte in a field, or for its name, comes back as a few characters of it."""
    with pytest.raises(InvalidInput) as caught:
        read_flight({**FLIGHT, **changes})
    assert len(caught.value.message) < 300


def places(document: Any, pointer: str = "") -> list[str]:
    """JSON pointers of everything in a document."""
    if isinstance(document, dict):
        below = document.items()
    elif isinstance(document, list):
        below = enumerate(document)  # type: ignore[assignment]
    else:
        return []
    found = []
    for key, value in below:
        found += [f"{pointer}/{key}", *places(value, f"{pointer}/{key}")]
    return found


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just(10**400),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


def error_of(read: Callable[[dict[str, Any]], object], document: dict[str, Any]) -> MorphError | None:
    """The library's error of reading a document, or None; any other exception passes through."""
    try:
        read(document)
    except MorphError as error:
        return error
    return None


@settings(deadline=None, max_examples=300)
@given(st.sampled_from(places(AIRCRAFT)), JSON)
def test_anything_anywhere_in_an_aircraft(field: str, value: Any) -> None:
    """Whatever stands in a field, the answer is an aircraft or an error of ours that points at it."""
    error = error_of(read_aircraft, with_value(AIRCRAFT, field, value))
    assert error is None or (error.pointer.startswith("/aircraft/") and error.hint)


@settings(deadline=None, max_examples=300)
@given(st.sampled_from(places(FLIGHT)), JSON)
def test_anything_anywhere_in_a_flight(field: str, value: Any) -> None:
    """The same for a flight condition."""
    error = error_of(read_flight, with_value(FLIGHT, field, value))
    assert error is None or (error.pointer.startswith("/flight/") and error.hint)
