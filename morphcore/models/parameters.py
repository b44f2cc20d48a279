"""The identifiable parameters of an equivalent model, as a list.

Search space, names, bounds, documents, uncertainty and warnings iterate over ``CHAIN_PARAMETERS``. To add a
parameter, add one entry to it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.aero.kernels.loads import (
    JONES_B1,
    JONES_B2,
    JONES_MEAN_LAG,
    L_CENTRE,
    L_CHORD_X,
    L_CHORD_Y,
    L_DRAG,
    L_DRAG_Y,
    L_FAST_WEIGHT,
    L_LIFT,
    L_MOMENT,
    L_MOMENT_Y,
    L_SKEW,
    L_SLOPE,
    L_SLOW_DECAY,
    L_TURN_Y,
)
from morphcore.geometry.surface import Surface
from morphcore.models.links import (
    MASS_ROWS,
    beam_division,
    drag_areas,
    joint_stiffness,
    link_edges,
    link_masses,
    moment_areas,
    segment_ends,
    strip_overlap,
    twist_slopes,
)
from morphcore.models.lumps import FLAT_ROWS, LUMP_ROWS, link_lumps
from morphcore.models.surface_rows import CutSurface, SurfaceRows
from morphcore.models.transforms import Linear, Log, Shares, Transform
from morphcore.multibody.kernels.articulated import L_MASS, L_OFFSET, L_UP

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
Scope = Literal["surface", "pair", "aircraft"]

AXIS_NAMES = ("flap", "torsion", "edgewise")
STIFFNESS_FACTOR = 10.0  # factor either way from beam theory: a chain of few links is off by less than three
DAMPING_FACTOR = 30.0
MIN_DAMPING_S = 1e-6  # s, times the stiffness: where the search for the damping of undamped wings starts
LAG_FACTOR = 10.0
LIFT_RANGE = (0.6, 1.5)
LIFT_UNIT = 0.2
CENTRE_RANGE_CHORDS = 0.15
CENTRE_UNIT_CHORDS = 0.05
DRAG_RANGE = (0.0, 0.08)
DRAG_UNIT = 0.01
NEUTRAL_LIFT_FACTOR = 1.0
# how far a search may widen its bounds where the flights push against them: a joint a hundred times stiffer
# than the beam is rigid, a softer one no wing; beyond, an aerodynamic correction would be another wing's
STIFFNESS_LIMIT_FACTOR = 100.0
DAMPING_LIMIT_FACTOR = 1000.0
LAG_LIMIT_FACTOR = 100.0
LIFT_LIMITS = (0.3, 2.5)
CENTRE_LIMIT_CHORDS = 0.5
DRAG_LIMITS = (0.0, 0.5)
ZERO_LIFT_RANGE = 0.2  # either way from the aircraft document's, like that of cm0
ZERO_LIFT_UNIT = 0.02
ZERO_LIFT_LIMITS = (-0.35, 0.35)
CM0_RANGE = 0.2
CM0_UNIT = 0.02
CM0_LIMITS = (-0.5, 0.5)
DIVISION_LIMIT_RATIO = 3.0  # of the log-ratios: a share over the last one 20 times smaller or larger
SHORTEST_LAG_S = 1e-9  # shorter lags are quasi-steady; avoids a division by zero


@dataclass(frozen=True)
class Parameter:
    """One kind of identifiable parameter.

    Attributes
    ----------
    name : str
        Name in bounds, documents and reports.
    unit : str
        Unit of its values, "1" if dimensionless.
    transform : callable, Surface -> Transform
        Search coordinates on a surface.
    bounds : callable, CutSurface -> (lower, upper)
        Default bounds (d,) of its search coordinates on a surface.
    guess : callable, CutSurface -> ndarray, shape (p, ...)
        Its physical values on a surface.
    limits : callable, CutSurface -> (lower, upper), optional
        How far physics lets a search widen those bounds (d,) where the flights push against them; None: not
        at all.
    apply : callable, (SurfaceRows, ndarray) -> None
        Writes values (p, ...) into the constants of a surface's links.
    scope : {"surface", "pair", "aircraft"}
        What has its own values: each surface (mirror images share them unless wings are separate), each
        mirror pair, or the aircraft.
    size : callable, Surface -> float
        Size, such as a chord, with which an aircraft-wide parameter scales on a surface.
    labels : callable, int -> tuple of str, optional
        Names of its values by number of links; None for a single value.
    coordinates : callable, int -> tuple of str, optional
        Names of its search coordinates by number of links, if they differ from those of the values.
    correction : bool
        Whether a request may exclude it from the search. Documents list it under ``aero``.
    asymmetric : bool
        Whether only flights with different sides determine it.
    on_request : bool
        Whether it is searched only where a request names it, among the corrections or by its bounds.
    factor : bool
        Whether different surfaces share one set of it as factors on their own guesses.
    default : float, optional
        Value used if a document omits it; None: it is required, or `own_default`.
    apart : bool
        Whether unlike surfaces may have their own values of one of the aircraft.
    own_default : bool
        Whether a document may omit it, which leaves it at the surface's own guess.
    at_bound : mapping of str to str
        Hints for a fit that ends at the "lower" or "upper" bound when widening the bound does not help.
    """

    name: str
    unit: str
    transform: Callable[[Surface], Transform]
    bounds: Callable[[CutSurface], tuple[Array, Array]]
    guess: Callable[[CutSurface], Array]
    apply: Callable[[SurfaceRows, Array], None]
    scope: Scope = "aircraft"
    size: Callable[[Surface], float] = lambda _: 1.0
    labels: Callable[[int], tuple[str, ...]] | None = None
    coordinates: Callable[[int], tuple[str, ...]] | None = None
    correction: bool = True
    asymmetric: bool = False
    on_request: bool = False
    factor: bool = False
    apart: bool = False
    limits: Callable[[CutSurface], tuple[Array, Array]] | None = None
    default: float | None = None
    own_default: bool = False
    at_bound: Mapping[str, str] = field(default_factory=dict)

    def names(self, links: int) -> tuple[str, ...]:
        """Names of its values."""
        if self.labels is None:
            return (self.name,)
        return tuple(f"{self.name}.{label}" for label in self.labels(links))

    def coordinate_names(self, links: int) -> tuple[str, ...]:
        """Names of its search coordinates."""
        return self.names(links) if self.coordinates is None else self.coordinates(links)

    def in_proportion(self, surface: Surface, reference: Surface) -> float:
        """Ratio of the value on a surface to that on the reference surface."""
        return self.size(surface) / self.size(reference)


def lag_weights(lag_s: Array, step_s: float) -> Array:
    """Weights of one step for both of Jones' exponentials.

    Parameters
    ----------
    lag_s : ndarray, shape (...)
        Mean lag times, s.
    step_s : float
        Length h of the step, s.

    Returns
    -------
    ndarray, shape (..., 4)
        For each of slow and fast: the decay e = exp(-h / T), and 1 - (1 - e) T / h.
    """
    weights = []
    for semichords in (1.0 / JONES_B1, 1.0 / JONES_B2):
        z = step_s / np.maximum(lag_s * semichords / JONES_MEAN_LAG, SHORTEST_LAG_S)
        weights += [np.exp(-z), 1.0 + np.expm1(-z) / z]
    return np.stack(weights, axis=-1)


def _joint_labels(links: int) -> tuple[str, ...]:
    return tuple(f"joint_{j + 1}.{axis}" for j in range(links - 1) for axis in AXIS_NAMES)


def _factor(centre: Array, factor: float) -> tuple[Array, Array]:
    """Logarithmic range of one factor in both directions."""
    middle = np.log(centre.ravel())
    return middle - np.log(factor), middle + np.log(factor)


# shares of the span


def _cut(rows: SurfaceRows, division: Array) -> None:
    """Masses, joint offsets, drag areas and strips of links with these shares of the span."""
    surface, edges = rows.surface, link_edges(division, rows.surface.length_m)
    particles = division.shape[0]
    rows.links[:, :, L_MASS : L_MASS + MASS_ROWS] = link_masses(surface, edges)
    if surface.point_masses:
        lumps = link_lumps(surface, edges)
        rows.links[:, :, L_MASS : L_MASS + MASS_ROWS] += lumps[..., :FLAT_ROWS]
        rows.links[:, :, L_UP : L_UP + LUMP_ROWS - FLAT_ROWS] = lumps[..., FLAT_ROWS:]
    rows.links[:, 1:, L_OFFSET] = surface.span_sign * np.diff(edges, axis=1)[:, :-1]
    rows.links[:, :, L_DRAG], rows.links[:, :, L_DRAG_Y] = drag_areas(surface, edges)
    rows.links[:, :, L_SLOPE : L_TURN_Y + 1] = twist_slopes(surface, edges)
    rows.links[:, :, L_MOMENT], rows.links[:, :, L_MOMENT_Y] = moment_areas(surface, edges)
    x, y, _ = surface.chord_W
    rows.links[:, :, L_CHORD_X], rows.links[:, :, L_CHORD_Y], rows.links[:, :, L_SKEW] = x, y, y / x
    weight, middle = strip_overlap(surface, rows.part, edges)
    rows.overlap[:] = np.stack([weight, middle], axis=-1).reshape(particles, -1)
    if surface.mouth_m is not None:  # models/kernels/telescope.py: areas of strips, each strip on any link
        rows.links[:, :, [L_DRAG, L_MOMENT]] = 1.0
        rows.links[:, :-1, L_DRAG_Y] = segment_ends(surface, edges)[:, 1:]
        rows.touched[:, :, 0], rows.touched[:, :, 1] = 0, rows.part.spanwise
        return
    is_touched = weight > 0.0
    rows.touched[:, :, 0] = np.argmax(is_touched, axis=1)
    rows.touched[:, :, 1] = rows.part.spanwise - np.argmax(is_touched[:, ::-1], axis=1)


DIVISION = Parameter(
    name="division",
    unit="1",
    transform=lambda surface: Shares(partial(beam_division, surface)),
    bounds=lambda cut: Shares(partial(beam_division, cut.surface)).box(0.0, 1.0, cut.division.shape[1]),
    guess=lambda cut: cut.division,
    apply=_cut,
    limits=lambda cut: Shares(partial(beam_division, cut.surface), DIVISION_LIMIT_RATIO).box(
        0.0, 1.0, cut.division.shape[1]
    ),
    scope="surface",
    labels=lambda links: tuple(str(k + 1) for k in range(links)),
    coordinates=lambda links: tuple(f"log_ratio.{k + 1}" for k in range(links - 1)),
    correction=False,
    at_bound=dict.fromkeys(("lower", "upper"), "the best value may lie beyond: try another number of links"),
)

# stiffness and damping of the gimbals


def _beam_stiffness(cut: CutSurface) -> Array:
    return joint_stiffness(cut.surface, cut.edges)


def _beam_damping(cut: CutSurface) -> Array:
    """Proportional damping c = beta k."""
    return _beam_stiffness(cut) * cut.surface.material.stiffness_damping_s


def _some_damping(cut: CutSurface) -> Array:
    """The same, and next to none where the beam has none."""
    return np.maximum(_beam_damping(cut), MIN_DAMPING_S * _beam_stiffness(cut))


def _stiffen(rows: SurfaceRows, stiffness: Array) -> None:
    rows.stiffness[:] = stiffness.reshape(rows.stiffness.shape)


def _damp(rows: SurfaceRows, damping: Array) -> None:
    rows.damping[:] = damping.reshape(rows.damping.shape)


STIFFNESS = Parameter(
    name="stiffness_nm_rad",
    unit="N m/rad",
    transform=lambda _: Log(),
    bounds=lambda cut: _factor(_beam_stiffness(cut), STIFFNESS_FACTOR),
    guess=_beam_stiffness,
    apply=_stiffen,
    limits=lambda cut: _factor(_beam_stiffness(cut), STIFFNESS_LIMIT_FACTOR),
    scope="surface",
    labels=_joint_labels,
    correction=False,
    factor=True,
)

DAMPING = Parameter(
    name="damping_nms_rad",
    unit="N m s/rad",
    transform=lambda _: Log(),
    bounds=lambda cut: _factor(_some_damping(cut), DAMPING_FACTOR),
    guess=_beam_damping,
    apply=_damp,
    limits=lambda cut: _factor(_some_damping(cut), DAMPING_LIMIT_FACTOR),
    scope="surface",
    labels=_joint_labels,
    correction=False,
    factor=True,
)

# aerodynamic corrections


def _chord(surface: Surface) -> float:
    return surface.mean_chord_m


def _neutral(value: float) -> Callable[[CutSurface], Array]:
    return lambda cut: np.full(cut.division.shape[0], value)


def _scale_lift(rows: SurfaceRows, factor: Array) -> None:
    rows.links[:, :, L_LIFT] = factor[:, None]


def _move_centre(rows: SurfaceRows, offset_m: Array) -> None:
    rows.links[:, :, L_CENTRE] = offset_m[:, None]


def _drag(rows: SurfaceRows, coefficient: Array) -> None:
    rows.links[:, :, L_DRAG] *= coefficient[:, None]


def _camber(rows: SurfaceRows, zero_lift_rad: Array) -> None:
    rows.links[:, :, L_SLOPE] -= zero_lift_rad[:, None]
    rows.links[:, :, L_TURN_Y] += rows.surface.chord_W[0] * zero_lift_rad[:, None]


def _pitch(rows: SurfaceRows, cm0: Array) -> None:
    rows.links[:, :, L_MOMENT] *= cm0[:, None]


def _lag(rows: SurfaceRows, lag_s: Array) -> None:
    weights = lag_weights(lag_s[:, None], rows.step_s)
    weights[..., ::2] **= 0.5  # the step advances the lag states by half steps
    rows.links[:, :, L_SLOW_DECAY : L_FAST_WEIGHT + 1] = weights


def _jones_lag_s(cut: CutSurface) -> float:
    """Mean lag of Jones' indicial function on the surface's mean chord, s."""
    return JONES_MEAN_LAG * _chord(cut.surface) / (2 * cut.flight.airspeed_m_s)


def _centre_box(cut: CutSurface, range_chords: float) -> tuple[Array, Array]:
    chord = _chord(cut.surface)
    return Linear(CENTRE_UNIT_CHORDS * chord).box(-range_chords * chord, range_chords * chord, 1)


def _around(value: float, reach: float, unit: float, limits: tuple[float, float]) -> tuple[Array, Array]:
    low, high = max(value - reach, limits[0]), min(value + reach, limits[1])
    return Linear(unit).box(low, high, 1)


LIFT_FACTOR = Parameter(
    name="lift_factor",
    unit="1",
    transform=lambda _: Linear(LIFT_UNIT, NEUTRAL_LIFT_FACTOR),
    bounds=lambda _: Linear(LIFT_UNIT, NEUTRAL_LIFT_FACTOR).box(*LIFT_RANGE, 1),
    guess=_neutral(NEUTRAL_LIFT_FACTOR),
    apply=_scale_lift,
    limits=lambda _: Linear(LIFT_UNIT, NEUTRAL_LIFT_FACTOR).box(*LIFT_LIMITS, 1),
    apart=True,
    default=NEUTRAL_LIFT_FACTOR,
)

AC_OFFSET = Parameter(
    name="ac_offset_m",
    unit="m",
    transform=lambda surface: Linear(CENTRE_UNIT_CHORDS * _chord(surface)),
    bounds=lambda cut: _centre_box(cut, CENTRE_RANGE_CHORDS),
    guess=_neutral(0.0),
    apply=_move_centre,
    limits=lambda cut: _centre_box(cut, CENTRE_LIMIT_CHORDS),
    size=_chord,
    default=0.0,
)

PROFILE_DRAG = Parameter(
    name="profile_drag",
    unit="1",
    transform=lambda _: Linear(DRAG_UNIT),
    bounds=lambda _: Linear(DRAG_UNIT).box(*DRAG_RANGE, 1),
    guess=lambda cut: np.full(cut.division.shape[0], cut.surface.profile_drag),
    apply=_drag,
    limits=lambda _: Linear(DRAG_UNIT).box(*DRAG_LIMITS, 1),
    scope="pair",
    # the drag of wings that move alike has no moment about the vertical and hardly affects pitch, so a fit
    # would use it to compensate other errors of pitch
    asymmetric=True,
    at_bound={"lower": "drag cannot be negative: the model may lack an effect that the samples show"},
)

LAG = Parameter(
    name="lag_s",
    unit="s",
    transform=lambda _: Log(),
    bounds=lambda cut: _factor(np.full(1, _jones_lag_s(cut)), LAG_FACTOR),
    guess=lambda cut: np.full(cut.division.shape[0], _jones_lag_s(cut)),
    apply=_lag,
    limits=lambda cut: _factor(np.full(1, _jones_lag_s(cut)), LAG_LIMIT_FACTOR),
    size=_chord,
)

ZERO_LIFT = Parameter(
    name="zero_lift_rad",
    unit="rad",
    transform=lambda _: Linear(ZERO_LIFT_UNIT),
    bounds=lambda cut: _around(cut.surface.zero_lift_rad, ZERO_LIFT_RANGE, ZERO_LIFT_UNIT, ZERO_LIFT_LIMITS),
    guess=lambda cut: np.full(cut.division.shape[0], cut.surface.zero_lift_rad),
    apply=_camber,
    limits=lambda _: Linear(ZERO_LIFT_UNIT).box(*ZERO_LIFT_LIMITS, 1),
    scope="pair",
    # a biased attitude sensor and a wing mounted askew look alike: whoever knows the section need not search
    on_request=True,
    own_default=True,
)

CM0 = Parameter(
    name="cm0",
    unit="1",
    transform=lambda _: Linear(CM0_UNIT),
    bounds=lambda cut: _around(cut.surface.cm0, CM0_RANGE, CM0_UNIT, CM0_LIMITS),
    guess=lambda cut: np.full(cut.division.shape[0], cut.surface.cm0),
    apply=_pitch,
    limits=lambda _: Linear(CM0_UNIT).box(*CM0_LIMITS, 1),
    scope="pair",
    on_request=True,
    own_default=True,
)

# in the order of search coordinates and reports; `division` defines the links that the others write to
CHAIN_PARAMETERS: list[Parameter] = [
    DIVISION,
    STIFFNESS,
    DAMPING,
    LIFT_FACTOR,
    AC_OFFSET,
    PROFILE_DRAG,
    LAG,
    ZERO_LIFT,
    CM0,
]
