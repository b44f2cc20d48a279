"""Warnings of results: numbers outside the validity of their method, and what to do about them.

Every result carries them as ``warnings``, and they are displayed with every result. A warning states the
observation and points to the part of the request that it concerns. If there is no answer at all, that is an
error, not a warning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.apparent_mass import share_of_mass
from morphcore.aero.environment import turbulence_scales
from morphcore.aero.stall import StallRecord
from morphcore.frames import quaternion_from_euler, rotation_from_quaternion
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.geometry.overlap import overlapping_surfaces
from morphcore.geometry.wake_contact import surfaces_in_wakes
from morphdata.atmosphere import standard_atmosphere
from morphdata.drives import without_side
from morphdata.environment import Environment
from morphdata.lattice import LatticeShape
from morphdata.trim_drives import UPRIGHT_RAD

Array = NDArray[np.float64]

# The lift of a thin airfoil is no longer linear by then; a lattice does not model stall.
LARGEST_ALPHA_RAD = np.radians(15.0)
LARGEST_APPARENT_SHARE = 0.1  # of a wing's mass: it then lowers the frequency of flapping by 5 per cent
LARGEST_MACH = 0.3  # below this, incompressible air is accurate to 5 per cent of the lift
# Five degrees from the vertical, roll and yaw act about nearly the same axis and their errors grow tenfold.
STEEPEST_PITCH_RAD = np.radians(85.0)
INCIDENCE_AXIS = 0.99  # cosine to y of B from which a hinge changes the incidence
LARGEST_TRIM_MOMENT = 0.01  # coefficient; a wing's own moment about its quarter chord is larger
# component of the moment in B, its name, the field of the drive that balances it, and what it is usually
LATERAL_TRIM = (
    (0, "rolling", "roll_trim_drive", "ailerons"),
    (2, "yawing", "yaw_trim_drive", "a fin with a rudder"),
)
# A plain flap loses its linear lift to separation at about this deflection (Abbott & von Doenhoff 1959).
LARGEST_DEFLECTION_RAD = np.radians(20.0)
# tip deflection over span; beyond it a lattice on the unbent wings needs 1.6 per cent more thrust and a third
# of a milliradian more angle of attack than one on the bent ones, see `bending_warnings`
LARGEST_BENDING = 0.15
MIN_STEPS_IN_GUST = 8.0  # a step then meets a 1 - cos gust within 4 per cent of its peak
MIN_STEPS_IN_SCALE = 2.0  # of turbulence: shorter waves than its scale have a tenth of the energy
NEAREST_WAKE_CHORDS = 0.75  # see `wake_warnings`
LARGEST_ERROR = 0.05  # share of the motion, rms
MIN_ERROR_RAD = 1e-4  # rad rms, resolution of the integration (simulate/time_grid.py)


@dataclass(frozen=True)
class ResultWarning:
    """One warning: a stable code, two sentences, a JSON pointer into the request ("" for the whole)."""

    code: str
    message: str
    hint: str
    pointer: str = ""

    def to_document(self) -> dict[str, Any]:
        """JSON form."""
        return {"code": self.code, "message": self.message, "hint": self.hint, "pointer": self.pointer}


@dataclass(frozen=True)
class AirMotion:
    """Motion through the air over a flight of k times: incidence (rad) and airspeed (m/s), both (k,).

    The incidence is that of the body, or of the section that incidence, hinges and twist incline furthest.
    stall : how near sections came to the limits of their lift; None without limits.
    """

    time_s: Array
    incidence: Array
    airspeed: Array
    stall: StallRecord | None = None


def air_motion(
    aircraft: Aircraft, time_s: Array, euler: Array, velocity_N: Array, wind_N: Array, angles: Array
) -> AirMotion:
    """Compute the motion through the air from attitudes, velocities and wind (k, 3) and hinge angles (k, h).

    A hinge inclines its surface by the part of its angle whose axis is perpendicular to the stream, twist its
    tip once more; of a surface's own incidence counts what its dihedral leaves in the vertical. A fin meets
    the sideslip.
    """
    air_N = velocity_N - wind_N
    R_NB = rotation_from_quaternion(quaternion_from_euler(*euler.T))
    air_B = np.einsum("kij,ki->kj", R_NB, air_N)
    alpha = np.arctan2(air_B[:, 2], air_B[:, 0])
    airspeed = np.asarray(np.linalg.norm(air_N, axis=1))
    across = np.array([0.0 if hinge.prismatic else hinge.axis_B[1] for hinge in aircraft.hinges])
    inclined = []
    for surface, own in zip(aircraft.surfaces, aircraft.hinge_columns, strict=True):
        root = surface.incidence_rad * np.cos(surface.dihedral_rad) + angles[:, own] @ across[own]
        if across[own].any() or surface.incidence_rad:
            inclined.append(root)
        if surface.twist_rad:
            inclined.append(root + surface.twist_rad)
    fins = any(abs(surface.dihedral_rad) >= UPRIGHT_RAD for surface in aircraft.surfaces)
    met = [np.arctan2(air_B[:, 1], np.hypot(air_B[:, 0], air_B[:, 2]))] if fins else []
    incidences = np.stack([alpha, *(alpha + angle for angle in inclined), *met])
    furthest = np.take_along_axis(incidences, np.abs(incidences).argmax(axis=0)[None], axis=0)[0]
    return AirMotion(time_s, furthest, airspeed)


def air_warnings(flight: Flight, motions: Sequence[tuple[str, str, AirMotion]]) -> list[ResultWarning]:
    """Incidence beyond the linear range of the lift, stalled sections, compressible flow without ``mach``.

    Parameters
    ----------
    motions : for each flight, its name in the message, its pointer in the request, and its motion.
    """
    found = []
    for name, pointer, motion in motions:
        worst = int(np.abs(motion.incidence).argmax())
        if abs(motion.incidence[worst]) > LARGEST_ALPHA_RAD:
            found.append(
                ResultWarning(
                    "large_alpha",
                    f"the angle of attack reaches {np.degrees(motion.incidence[worst]):.1f} degrees at "
                    f"t = {motion.time_s[worst]:.2f} s in {name}",
                    "the vortex lattice does not model stall, which a real wing meets at about "
                    f"{np.degrees(LARGEST_ALPHA_RAD):.0f} degrees: fly faster, lighter or a gentler morph, "
                    "or trust the result only up to that angle",
                    pointer,
                )
            )
        found += stall_warnings(motion.stall, motion.time_s, name, pointer)
    fastest = max([flight.airspeed_m_s, *(float(motion.airspeed.max()) for _, _, motion in motions)])
    mach = fastest / standard_atmosphere(flight.altitude_m).speed_of_sound_m_s
    if flight.mach is None and mach > LARGEST_MACH:
        lift = 100.0 * (1.0 / np.sqrt(1.0 - mach**2) - 1.0) if mach < 0.9 else None
        more = "" if lift is None else f", which leaves out about {lift:.0f} per cent of the lift"
        found.append(
            ResultWarning(
                "compressible",
                f"the flight reaches Mach {mach:.2f} and is computed as incompressible{more}",
                'set flight.mach to "auto" (up to Mach 0.7), or to 0 if incompressible flow is intended',
                "/flight/mach",
            )
        )
    return found


def light_wing_warnings(aircraft: Aircraft, flight: Flight) -> list[ResultWarning]:
    """Wings so light that the apparent mass of the air matters, in a flight that leaves it out."""
    if flight.apparent_mass:
        return []
    density = flight.air_density_kg_m3
    share, name = max((share_of_mass(surface, density), surface.name) for surface in aircraft.surfaces)
    if share <= LARGEST_APPARENT_SHARE:
        return []
    return [
        ResultWarning(
            "apparent_mass_left_out",
            f"the air that {name!r} moves with it has {100.0 * share:.0f} per cent of its mass",
            "it is left out: set flight.apparent_mass to true, unless the source of the samples omits it too",
            "/flight/apparent_mass",
        )
    ]


def overlap_warnings(aircraft: Aircraft, angles: Array) -> list[ResultWarning]:
    """Surfaces that overlap at any of some angles (k, h) of all hinges, rad."""
    found = []
    for first, second, row in overlapping_surfaces(aircraft, angles):
        names = [aircraft.surfaces[number].name for number in (first, second)]
        turned = ", ".join(
            f"{aircraft.surfaces[number].name} at "
            f"{', '.join(f'{angle:.3g}' for angle in angles[row, aircraft.hinge_columns[number]])} rad"
            for number in (first, second)
            if aircraft.surfaces[number].hinges
        )
        found.append(
            ResultWarning(
                "surfaces_overlap",
                f"{names[0]!r} and {names[1]!r} overlap" + (f" ({turned})" if turned else ""),
                "their lattices intersect and the air loads are meaningless there: check position_m, "
                "span_m and the hinges",
                f"/aircraft/surfaces/{second}",
            )
        )
    return found


def deflection_warnings(aircraft: Aircraft, angles: Array) -> list[ResultWarning]:
    """Controls beyond the linear range of a flap at any of some angles (k, h + c) of hinges and controls."""
    furthest = {
        control.drive: float(np.abs(column).max(initial=0.0))
        for control, column in zip(aircraft.controls, angles.T[len(aircraft.hinges) :], strict=True)
    }
    return [
        ResultWarning(
            "large_deflection",
            f"the control {drive} is deflected by {deflection:.2f} rad",
            "its air loads are linear in the deflection: a real flap separates at about "
            f"{LARGEST_DEFLECTION_RAD:.2f} rad; trust the result only up to that deflection",
            "/aircraft/surfaces",
        )
        for drive, deflection in furthest.items()
        if deflection > LARGEST_DEFLECTION_RAD
    ]


def stall_warnings(record: StallRecord | None, time_s: Array, name: str, pointer: str) -> list[ResultWarning]:
    """Sections whose lift was cut off at the limit of their polar, at any of the times (k,)."""
    if record is None or not (record.ratio > 1.0).any():
        return []
    row = int(np.argmax(record.ratio))
    first = float(time_s[int(np.argmax(record.ratio > 1.0))])
    surface, at, needed, limit = record.worst(row)
    return [
        ResultWarning(
            "stalled",
            f"sections stall in {name} from t = {first:.2f} s on: at {time_s[row]:.2f} s attached flow would "
            f"give a lift coefficient of {needed:.3g} at {100.0 * at:.0f} per cent of the span of "
            f"{surface!r}, whose limit is {limit:.3g}",
            "their lift is cut off at the limit; drag, moment and hysteresis of separated flow are not "
            "modelled: trust the result only up to that time",
            pointer,
        )
    ]


def gust_warnings(environment: Environment | None, flight: Flight, step_s: float) -> list[ResultWarning]:
    """A gust or turbulence too short for the time step (s)."""
    found = []
    if environment is not None and environment.gust is not None:
        steps = 2.0 * environment.gust.gradient_m / (flight.airspeed_m_s * step_s)
        if steps < MIN_STEPS_IN_GUST:
            found.append(("the gust passes", steps, MIN_STEPS_IN_GUST, "/environment/gust/gradient_m"))
    if environment is not None and environment.turbulence is not None:
        length = float(turbulence_scales(environment.turbulence, flight.altitude_m)[1].min())
        steps = length / (flight.airspeed_m_s * step_s)
        if steps < MIN_STEPS_IN_SCALE:
            passes = "the shortest length scale of the turbulence passes"
            found.append((passes, steps, MIN_STEPS_IN_SCALE, "/environment/turbulence"))
    return [
        ResultWarning(
            "gust_unresolved",
            f"{what} in {steps:.2g} time steps of {1e3 * step_s:.3g} ms, which do not resolve it",
            f"choose model.step_s of at most {1e3 * step_s * steps / enough:.2g} ms",
            pointer,
        )
        for what, steps, enough, pointer in found
    ]


def bending_warnings(
    aircraft: Aircraft, bending: Array, name: str, pointer: str, shape: LatticeShape
) -> list[ResultWarning]:
    """Wings bent further from the shape of their lattice than it is good for.

    Trims of Patil's wing as a chain, with the tables against a fresh lattice on the bent chain
    (tests/simulate/test_trimmed_shape.py): on unbent wings the thrust is too large by 0.5, 1.4, 2.3, 3.4
    and 5 per cent at a tip deflection of 5, 13, 20, 27 and 36 per cent of the span, the angle of attack by
    0.1, 0.25, 0.4, 0.7 and 1 mrad; on wings bent as in trim by a tenth of that.

    Parameters
    ----------
    bending : (k, s) displacement of the tips from the lattice's shape over the span, at k times. shape : of
    the lattice.
    """
    if not bending.size or not (bending > LARGEST_BENDING).any():
        return []
    row, number = np.unravel_index(int(np.argmax(bending)), bending.shape)
    surface, trimmed = aircraft.surfaces[int(number)], shape == "trimmed"
    return [
        ResultWarning(
            "large_bending",
            f"the tip of {surface.name!r} moves by {100.0 * bending[row, number]:.0f} per cent of its span "
            + (
                f"from its place in the trim of the nominal wings in {name}, and the lattice of an "
                "equivalent model stays there"
                if trimmed
                else f"in {name}, and the lattice of an equivalent model stays on the unbent wings"
            ),
            f"beyond {100.0 * LARGEST_BENDING:.0f} per cent of bending that the lattice leaves out, thrust "
            "was found off by 1.6 per cent and more, the angle of attack by 0.3 mrad: "
            + (
                "compare with the flexible model, whose lattice bends with the wings"
                if trimmed
                else 'set lattice.shape to "trimmed", which puts the lattice on wings bent as in trim, or '
                "compare with the flexible model"
            ),
            pointer,
        )
    ]


def steep_warning(name: str, pointer: str, theta: Array) -> list[ResultWarning]:
    """A pitch angle near or beyond the vertical, where Euler angles become degenerate."""
    steepest = float(np.abs(theta).max())
    if steepest <= STEEPEST_PITCH_RAD:
        return []
    beyond = steepest > 0.5 * np.pi
    return [
        ResultWarning(
            "steep_pitch",
            f"theta reaches {steepest:.3g} rad in {name}"
            + (", beyond the vertical" if beyond else ", nearly the vertical"),
            "the Euler angle theta cannot exceed pi/2: check the unit, which may be degrees"
            if beyond
            else "roll and yaw cannot be distinguished there: do not interpret or fit them near that time",
            pointer,
        )
    ]


def trim_warnings(
    aircraft: Aircraft, flight: Flight, moment_B: Array, balanced: Sequence[int] = ()
) -> list[ResultWarning]:
    """Moments (3,), N m, that only a constant moment balances although a drive could.

    In pitch only drives of incidence count, those whose hinges turn about y of B, and controls that deflect
    alike on both sides of surfaces that lift. In roll and yaw moments of asymmetric flights are told even if
    the aircraft has no control for them: it could not fly so.

    Parameters
    ----------
    balanced : components of the moment that a drive of the flight balances, in the rigid model entirely.
    """
    area = sum(surface.area_m2 for surface in aircraft.surfaces)
    chord = max(surface.mean_chord_m for surface in aircraft.surfaces)
    coefficient = np.abs(moment_B) / (flight.dynamic_pressure_pa * area * chord)
    found = []
    able = _pitching_drives(aircraft)
    if flight.trim_drive is None and able and not coefficient[1] < LARGEST_TRIM_MOMENT:
        found.append(
            ResultWarning(
                "constant_trim_moment",
                f"a constant moment of {moment_B[1]:.4g} N m, which no control supplies, holds the aircraft "
                "in trim",
                "let a drive balance it: set flight.trim_drive (the aircraft has "
                f"{', '.join(able)}). A constant moment does not change with speed, and so spoils slow "
                "motions such as the phugoid",
                "/flight",
            )
        )
    for axis, name, field, drive in LATERAL_TRIM if flight.is_asymmetric else ():
        if coefficient[axis] < LARGEST_TRIM_MOMENT:
            continue
        hint = (
            f"give the aircraft {drive}, or name a drive as flight.{field}: without one it could not fly so"
        )
        if axis in balanced:
            hint = "its drive is at the rigid model's angle, and bending takes from its effect: the flexible "
            hint += "model finds its own angle"
        found.append(
            ResultWarning(
                "constant_trim_moment",
                f"a constant {name} moment of {moment_B[axis]:.4g} N m, which no control supplies, holds the "
                "aircraft in trim",
                hint,
                "/flight",
            )
        )
    return found


def _pitching_drives(aircraft: Aircraft) -> list[str]:
    turning = (hinge for hinge in aircraft.hinges if not hinge.prismatic)
    able = {hinge.drive: None for hinge in turning if abs(hinge.axis_B[1]) > INCIDENCE_AXIS}
    opposed = {without_side(control.drive) for control in aircraft.controls if control.sign < 0.0}
    for surface in aircraft.surfaces:
        if abs(surface.dihedral_rad) < UPRIGHT_RAD:
            words = (without_side(control.drive) for control in surface.controls)
            able |= {word: None for word in words if word not in opposed}
    return list(able)


def wake_warnings(
    aircraft: Aircraft, angles: Array, alpha_rad: float, pointer: str, sideslip_rad: float = 0.0
) -> list[ResultWarning]:
    """A surface in the wake of another one, in a model whose wake keeps the direction that it has in trim.

    An all-rigid aircraft whose elevator was moved: pitch differs by up to 0.04 of the motion from the model
    whose wake moves, most at half a chord from the wing's wake, and by 0.02 at 1.3 chords. Within a quarter
    of a chord it is up to 0.2 with the core law "smoothed", whose wake remains single vortices.

    Parameters
    ----------
    angles : (h,) of all hinges at the start, rad. alpha_rad, sideslip_rad : there.
    """
    pairs = surfaces_in_wakes(aircraft, angles, alpha_rad, sideslip_rad)
    worst = min(pairs, key=lambda pair: pair[2], default=None)
    if worst is None or worst[2] > NEAREST_WAKE_CHORDS:
        return []
    ahead, behind = (aircraft.surfaces[number].name for number in worst[:2])
    return [
        ResultWarning(
            "surface_in_wake",
            f"{behind!r} comes within {worst[2]:.2f} chords of the wake of {ahead!r}, which keeps its "
            "direction in rigid and equivalent models",
            "its loads depend on where the wake passes: compare with the flexible model, whose wake moves",
            pointer,
        )
    ]


def error_warning(name: str, pointer: str, errors: Array, motion: Array) -> list[ResultWarning]:
    """An error (k, 3) above LARGEST_ERROR of a sample's motion (k, 3), both rms of the angles together."""
    error, size = (float(np.sqrt(np.mean(np.sum(values**2, axis=1)))) for values in (errors, motion))
    if not np.isfinite(error) or error <= max(LARGEST_ERROR * size, MIN_ERROR_RAD):
        return []
    share = (
        f"{100.0 * error / size:.0f} per cent of its motion"
        if size > 0.0
        else "although the sample does not move"
    )
    return [
        ResultWarning(
            "large_error",
            f"the model misses {name} by {1e3 * error:.2g} mrad rms, {share}",
            "more links, more time or other samples may help; an aircraft, a flight condition or units that "
            "are not the sample's leave errors as well",
            pointer,
        )
    ]


def documents(warnings: Sequence[ResultWarning]) -> list[dict[str, Any]]:
    """JSON form of a result's warnings."""
    return [warning.to_document() for warning in warnings]
