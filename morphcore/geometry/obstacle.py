"""Likely reasons, from the document alone, why an aircraft does not fly: a soft wing, too little air.

Estimates from beam theory and from the lift that the flight needs. They name the field to check after a trim
or a flight has failed; they do not reject anything themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from morphcore.errors import FlightDiverged, TrimNotFound
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.geometry.surface import Surface

STATIONS = 200  # midpoints along the span
LARGEST_SLOPE_RAD = 1.0  # slope of a tip under its share of the load: beyond this no wing carries any load
LARGEST_LIFT_COEFFICIENT = 2.0  # lift coefficient of all surfaces together; a clean wing reaches 1.5 at most
LIFT_SLOPE = 2.0 * np.pi  # 1/rad, of a thin airfoil
SWEEP_WITHOUT_DIVERGENCE_RAD = 0.2  # swept aft by more, bending relieves a wing of its incidence


@dataclass(frozen=True)
class Obstacle:
    """The most likely reason why an aircraft does not fly: the field at fault, and a remedy."""

    pointer: str
    hint: str


def obstacle(aircraft: Aircraft, flight: Flight) -> Obstacle | None:
    """The most likely obstacle for wings with the document's stiffness; None if all estimates are fine."""
    load_n_m = load_per_length(aircraft, flight)
    softest = max(
        (
            (_tip_slope(surface, load_n_m), number)
            for number, surface in enumerate(aircraft.surfaces)
            if surface.flexible
        ),
        default=(0.0, 0),
    )
    if softest[0] > LARGEST_SLOPE_RAD:
        return _too_soft(aircraft.surfaces[softest[1]], softest[1], softest[0])
    thin = too_little_air(aircraft, flight)
    if thin is not None:
        return thin
    for number, surface in enumerate(aircraft.surfaces):
        if surface.flexible and flight.dynamic_pressure_pa > _divergence_pressure(surface):
            return _twists_off(surface, number, flight)
    return None


def too_little_air(aircraft: Aircraft, flight: Flight) -> Obstacle | None:
    """The flight condition as an obstacle, if no wing of that area could carry the weight in it."""
    factor = flight.load_factor
    weight_n = _mass(aircraft) * flight.gravity_m_s2 * factor
    area = sum(surface.area_m2 * _share_of_lift(surface) for surface in aircraft.surfaces)
    carried = flight.dynamic_pressure_pa * area * LARGEST_LIFT_COEFFICIENT
    if weight_n <= carried:
        return None
    needs = "weighs" if factor == 1.0 else f"needs a lift of {factor:.3g} times its weight,"
    return Obstacle(
        "/flight/airspeed_m_s",
        f"the aircraft {needs} {weight_n:.4g} N, and {area:.3g} m^2 at a dynamic pressure of "
        f"{flight.dynamic_pressure_pa:.3g} Pa carry {carried:.3g} N at most: check airspeed_m_s, "
        "air_density_kg_m3 and the densities of the materials",
    )


@contextmanager
def naming_obstacles(find: Callable[[], Obstacle | None]) -> Iterator[None]:
    """Add the most likely obstacle to the error of a trim or flight that fails within the block.

    ``find`` : returns the obstacle; called only after a failure.
    """
    try:
        yield
    except (TrimNotFound, FlightDiverged) as error:
        found = find()
        if found is not None:
            # what a trim has found to work remains true
            kept = error.hint if isinstance(error, TrimNotFound) and found.hint not in error.hint else ""
            error.pointer, error.hint = found.pointer, f"{found.hint}; {kept}" if kept else found.hint
        raise


def lift_coefficient(aircraft: Aircraft, flight: Flight) -> float:
    """The lift coefficient of the steady flight, of all surfaces that carry weight; 0 without air."""
    area = sum(surface.area_m2 * _share_of_lift(surface) for surface in aircraft.surfaces)
    carried = flight.dynamic_pressure_pa * area
    weight_n = _mass(aircraft) * flight.gravity_m_s2 * flight.load_factor
    return weight_n / carried if carried > 0.0 else 0.0


def load_per_length(aircraft: Aircraft, flight: Flight) -> float:
    """The steady flight's lift distributed evenly over all spans, N/m: an estimate per length."""
    weight_n = _mass(aircraft) * flight.gravity_m_s2 * flight.load_factor
    length_m = sum(surface.length_m * _share_of_lift(surface) for surface in aircraft.surfaces)
    return weight_n / length_m if length_m > 0.0 else 0.0


def _share_of_lift(surface: Surface) -> float:
    """Cosine of the dihedral: fins carry no weight."""
    return float(abs(np.cos(surface.dihedral_rad)))


def _mass(aircraft: Aircraft) -> float:
    wings = 0.0
    for surface in aircraft.surfaces:
        distance, width = _stations(surface)
        wings += float(surface.section_at(distance).mass.sum()) * width
        wings += sum(mass.mass_kg for mass in surface.point_masses)
    return aircraft.fuselage.mass_kg + wings


def _stations(surface: Surface) -> tuple[np.ndarray, float]:
    width = surface.length_m / STATIONS
    return (np.arange(STATIONS) + 0.5) * width, width


def _tip_slope(surface: Surface, load_n_m: float) -> float:
    """Slope at the tip of a cantilever under a load per length, rad: the integral of M / EI."""
    distance, width = _stations(surface)
    moment = 0.5 * load_n_m * (surface.length_m - distance) ** 2
    with np.errstate(over="ignore"):  # for a modulus close to zero
        return float((moment / surface.section_at(distance).ei_flap).sum()) * width


def _divergence_pressure(surface: Surface) -> float:
    """Divergence pressure of an unswept wing by strip theory, Pa; infinite if it cannot diverge.

    Bisplinghoff, Ashley & Halfman (1955), section 8-3: q = (pi / 2 L)^2 GJ / (e c a), with the lift e ahead
    of the elastic axis, for the mean section.
    """
    ahead = 0.25 * surface.mean_chord_m + surface.elastic_axis_offset_m
    if ahead <= 0.0 or surface.sweep_rad > SWEEP_WITHOUT_DIVERGENCE_RAD:
        return float("inf")
    stiffness = float(surface.section_at(_stations(surface)[0]).gj.mean())
    return (0.5 * np.pi / surface.length_m) ** 2 * stiffness / (ahead * surface.mean_chord_m * LIFT_SLOPE)


def _too_soft(surface: Surface, number: int, slope: float) -> Obstacle:
    root = float(surface.section_at(np.zeros(1)).ei_flap[0])
    field, name = _stiffness_field(surface, "ei_flap_n_m2", "youngs_modulus_pa")
    return Obstacle(
        f"/aircraft/surfaces/{number}/{field}",
        f"{surface.name!r} is too soft to carry its share of the weight: EI = {root:.3g} N m^2 would bend "
        f"its tip by {slope:.3g} rad; check {name}, thickness_m and the chord (in SI units: 2.1 GPa is "
        "2.1e9 Pa)",
    )


def _twists_off(surface: Surface, number: int, flight: Flight) -> Obstacle:
    field, name = _stiffness_field(surface, "gj_n_m2", "youngs_modulus_pa")
    return Obstacle(
        f"/aircraft/surfaces/{number}/{field}",
        f"{surface.name!r} twists off (divergence) above about {_divergence_pressure(surface):.3g} Pa of "
        f"dynamic pressure, the flight has {flight.dynamic_pressure_pa:.3g} Pa: check {name}, "
        "elastic_axis_offset_m and airspeed_m_s",
    )


def _stiffness_field(surface: Surface, given: str, derived: str) -> tuple[str, str]:
    name = given if surface.section is not None else derived
    return f"{'section' if surface.section is not None else 'material'}/{name}", name
