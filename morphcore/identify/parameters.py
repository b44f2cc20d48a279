"""The unknowns of an identification and the coordinates in which they are searched.

Stiffness, damping and lag time are searched as logarithms; the division lengths, which sum to the span, as
log-ratios to the last link (Aitchison 1982, the additive log-ratio: a box in them is inside the simplex); the
other corrections linearly, in units of their natural size. So all coordinates are of order one and a
difference step fits all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.models.equivalent import ChainModel, ParameterBatch, physical_guess

Array = NDArray[np.float64]

AERO_COEFFICIENTS = ("lift_factor", "centre_shift_m", "profile_drag", "lag_s")
AXIS_NAMES = ("flap", "torsion", "lag")
STIFFNESS_FACTOR = 10.0  # either way from beam theory: a chain of few links is off by less than three
DAMPING_FACTOR = 30.0
LAG_FACTOR = 10.0
RATIO_RANGE = 1.5  # of the log-ratios: a link may be 4.5 times shorter or longer than the last
LIFT_RANGE = (0.6, 1.5)
LIFT_UNIT = 0.2
CENTRE_RANGE_CHORDS = 0.15
CENTRE_UNIT_CHORDS = 0.05
DRAG_RANGE = (0.0, 0.08)
DRAG_UNIT = 0.01
BOUND_NAMES = ("stiffness_nm_rad", "damping_nms_rad", "division", *AERO_COEFFICIENTS)
LARGEST_DECADES = 12.0
BOUND_TOLERANCE = 1e-3  # of the box's width; half a per cent of a stiffness
WARM_START = "/search/warm_start"  # where a request says what to begin from


@dataclass(frozen=True)
class SearchSpace:
    """Box of search coordinates and the way from them to parameters.

    names : what each coordinate stands for. lower, upper, guess : (d,). wing_sets : 1, or the number of
    flexible surfaces.
    free_aero : the corrections that are searched; the others keep the guess.
    """

    model: ChainModel
    names: tuple[str, ...]
    lower: Array
    upper: Array
    guess: Array
    wing_sets: int
    free_aero: tuple[str, ...]
    fixed: ParameterBatch = field(repr=False)

    @property
    def dimension(self) -> int:
        """Number of unknowns d."""
        return int(self.guess.size)

    @property
    def links(self) -> int:
        """Links per wing."""
        return self.model.links_per_wing

    def decode(self, x: Array) -> ParameterBatch:
        """Parameters of search points (p, d)."""
        x = np.atleast_2d(x)
        p, w, n = x.shape[0], self.wing_sets, self.links
        ratios, stiffness, damping, aero = np.split(
            x, np.cumsum([w * (n - 1), 3 * w * (n - 1), 3 * w * (n - 1)]), axis=1
        )
        ratios = np.concatenate([ratios.reshape(p, w, n - 1), np.zeros((p, w, 1))], axis=2)
        shares = np.exp(ratios - ratios.max(axis=2, keepdims=True))
        values = {name: np.repeat(getattr(self.fixed, _FIELDS[name]), p) for name in AERO_COEFFICIENTS}
        for name, column in zip(self.free_aero, aero.T, strict=True):
            values[name] = _decode_aero(name, column, self._chord)
        return ParameterBatch(
            division=shares / shares.sum(axis=2, keepdims=True),
            stiffness=np.exp(stiffness).reshape(p, w, n - 1, 3),
            damping=np.exp(damping).reshape(p, w, n - 1, 3),
            lift_factor=values["lift_factor"],
            centre_shift=values["centre_shift_m"],
            profile_drag=values["profile_drag"],
            lag=values["lag_s"],
        )

    def encode(self, batch: ParameterBatch) -> Array:
        """The search point (d,) of a model (one particle), moved into the bounds.

        Corrections that are not searched keep their fixed values.

        Raises
        ------
        InvalidInput : it has other links than are sought, or wings of its own where all are sought alike.
        """
        if batch.links != self.links:
            raise InvalidInput(
                f"the search seeks {self.links} links per wing, the model to begin from has {batch.links}",
                pointer=WARM_START,
                hint=f"begin from a model with {self.links}, or set model.links_per_wing to {batch.links}",
            )
        wings = batch.division.shape[1]
        if wings not in (1, self.wing_sets):
            raise InvalidInput(
                f"the search would begin from a model with {wings} wings of their own",
                pointer=WARM_START,
                hint="set model.separate_wings, or begin from a model whose wings are alike",
            )
        shares = np.repeat(batch.division, self.wing_sets // wings, axis=1)
        stiffness = np.repeat(batch.stiffness, self.wing_sets // wings, axis=1)
        damping = np.repeat(batch.damping, self.wing_sets // wings, axis=1)
        with np.errstate(divide="ignore"):  # no stiffness or damping at all: the lower bound stands for it
            parts = [
                np.log(shares[0, :, :-1] / shares[0, :, -1:]).ravel(),
                np.log(stiffness[0]).ravel(),
                np.log(damping[0]).ravel(),
                *(
                    _encode_aero(name, getattr(batch, _FIELDS[name])[:1], self._chord)
                    for name in self.free_aero
                ),
            ]
        return np.asarray(np.clip(np.concatenate(parts), self.lower, self.upper))

    @property
    def _chord(self) -> float:
        return self.model.aircraft.surfaces[0].mean_chord_m

    def flatten(self, batch: ParameterBatch) -> Array:
        """Named parameters in SI units (p, m), ordered as ``parameter_names``, fixed ones included."""
        p = batch.particles
        aero = np.stack([getattr(batch, _FIELDS[name]) for name in AERO_COEFFICIENTS], axis=1)
        return np.concatenate(
            [
                batch.division.reshape(p, -1),
                batch.stiffness.reshape(p, -1),
                batch.damping.reshape(p, -1),
                aero,
            ],
            axis=1,
        )

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the columns of ``flatten``."""
        wings = [""] if self.wing_sets == 1 else [f"wing_{i + 1}." for i in range(self.wing_sets)]
        joints = [f"joint_{j + 1}.{axis}" for j in range(self.links - 1) for axis in AXIS_NAMES]
        return (
            *(f"{wing}division.{k + 1}" for wing in wings for k in range(self.links)),
            *(f"{wing}stiffness_nm_rad.{joint}" for wing in wings for joint in joints),
            *(f"{wing}damping_nms_rad.{joint}" for wing in wings for joint in joints),
            *AERO_COEFFICIENTS,
        )

    @property
    def searched(self) -> NDArray[np.bool_]:
        """(m,) which named parameters are searched; the others are fixed."""
        joints = self.links > 1
        own = [joints] * (len(self.parameter_names) - len(AERO_COEFFICIENTS))
        return np.array([*own, *(name in self.free_aero for name in AERO_COEFFICIENTS)])

    @property
    def parameter_limits(self) -> Array:
        """(m, 2) least and greatest value of each named parameter within the box, SI units."""
        box = self.flatten(self.decode(np.stack([self.lower, self.upper]))).T
        n, w = self.links, self.wing_sets
        ratios = [bound[: w * (n - 1)].reshape(w, n - 1) for bound in (self.lower, self.upper)]
        # the last link's ratio to itself is one
        low, high = (np.exp(np.concatenate([bound, np.zeros((w, 1))], axis=1)) for bound in ratios)
        least = low / (low + high.sum(axis=1, keepdims=True) - high)
        most = high / (high + low.sum(axis=1, keepdims=True) - low)
        box[: w * n] = np.stack([least.ravel(), most.ravel()], axis=1)
        return np.asarray(box)

    def at_bound(self, x: Array) -> dict[str, str]:
        """Named parameters whose search coordinate in x (d,) lies at its bound, and which: "lower", "upper".

        A link's length is searched as its ratio to the last link's, and stands for that ratio here.
        """
        near = BOUND_TOLERANCE * (self.upper - self.lower)
        at = np.select([x <= self.lower + near, x >= self.upper - near], ["lower", "upper"], "")
        return {
            name.replace("log_ratio", "division"): str(end)
            for name, end in zip(self.names, at, strict=True)
            if end
        }


_FIELDS = {
    "lift_factor": "lift_factor",
    "centre_shift_m": "centre_shift",
    "profile_drag": "profile_drag",
    "lag_s": "lag",
}


def _decode_aero(name: str, x: Array, chord: float) -> Array:
    if name == "lag_s":
        return np.exp(x)
    if name == "lift_factor":
        return 1.0 + LIFT_UNIT * x
    return x * (CENTRE_UNIT_CHORDS * chord if name == "centre_shift_m" else DRAG_UNIT)


def _encode_aero(name: str, value: Array | float, chord: float) -> Array:
    value = np.asarray(value, dtype=np.float64)
    if name == "lag_s":
        return np.log(value)
    if name == "lift_factor":
        return (value - 1.0) / LIFT_UNIT
    return np.asarray(value / (CENTRE_UNIT_CHORDS * chord if name == "centre_shift_m" else DRAG_UNIT))


def search_space(
    model: ChainModel,
    *,
    separate_wings: bool = False,
    aero_coefficients: Sequence[str] = AERO_COEFFICIENTS,
    bounds: Mapping[str, Sequence[float]] | None = None,
) -> SearchSpace:
    """The unknowns of a model, bounded around beam and thin-airfoil theory.

    ``bounds`` overrides them: low and high in SI units for any of ``BOUND_NAMES``.

    Raises
    ------
    InvalidInput : a bound is unknown, empty, of the wrong sign or absurdly wide, or a correction is unknown.
    """
    given = dict(bounds or {})
    for name, pair in given.items():
        _check_bound(name, pair)
    for index, name in enumerate(aero_coefficients):
        if name not in AERO_COEFFICIENTS:
            raise InvalidInput(
                f"{name!r} is not an aerodynamic correction",
                pointer=f"/model/aero_coefficients/{index}",
                hint=f"use some of {', '.join(AERO_COEFFICIENTS)}",
            )
    free_aero = tuple(name for name in AERO_COEFFICIENTS if name in aero_coefficients)
    flexible = max(1, len(model.aircraft.flexible_surfaces))
    wing_sets = flexible if separate_wings else 1
    fixed = physical_guess(model, wing_sets=wing_sets)
    n, chord = model.links_per_wing, model.aircraft.surfaces[0].mean_chord_m
    wings = [""] if wing_sets == 1 else [f"wing_{i + 1}." for i in range(wing_sets)]
    joints = [f"joint_{j + 1}.{axis}" for j in range(n - 1) for axis in AXIS_NAMES]
    names = [f"{wing}log_ratio.{k + 1}" for wing in wings for k in range(n - 1)]
    guess = [np.zeros(wing_sets * (n - 1))]
    half = [_ratio_range(n, given.get("division")) * np.ones(wing_sets * (n - 1))]
    lower, upper = [-half[0]], [half[0]]
    for label, value, factor in (
        ("stiffness_nm_rad", fixed.stiffness, STIFFNESS_FACTOR),
        ("damping_nms_rad", np.maximum(fixed.damping, 1e-6 * fixed.stiffness), DAMPING_FACTOR),
    ):
        names += [f"{wing}{label}.{joint}" for wing in wings for joint in joints]
        centre = np.log(value.ravel())
        low, high = centre - np.log(factor), centre + np.log(factor)
        if label in given:
            low, high = (np.full_like(centre, np.log(bound)) for bound in given[label])
        guess.append(np.clip(centre, low, high))
        lower.append(low)
        upper.append(high)
    ranges = {
        "lift_factor": LIFT_RANGE,
        "centre_shift_m": (-CENTRE_RANGE_CHORDS * chord, CENTRE_RANGE_CHORDS * chord),
        "profile_drag": DRAG_RANGE,
        "lag_s": (model.natural_lag_s / LAG_FACTOR, model.natural_lag_s * LAG_FACTOR),
    }
    for name in free_aero:
        low, high = (_encode_aero(name, bound, chord) for bound in given.get(name, ranges[name]))
        names.append(name)
        guess.append(np.clip(_encode_aero(name, getattr(fixed, _FIELDS[name])[0], chord), low, high)[None])
        lower.append(low[None])
        upper.append(high[None])
    return SearchSpace(
        model=model,
        names=tuple(names),
        lower=np.concatenate(lower),
        upper=np.concatenate(upper),
        guess=np.concatenate(guess),
        wing_sets=wing_sets,
        free_aero=free_aero,
        fixed=fixed,
    )


def _ratio_range(links: int, bound: Sequence[float] | None) -> float:
    """Half width of the log-ratios for which every share stays inside [low, high]."""
    if bound is None or links == 1:
        return RATIO_RANGE
    low, high = bound
    if not low * links < 1.0 < high * links:
        raise InvalidInput(
            f"division bounds {low:g}..{high:g} leave no room for {links} links",
            pointer="/model/bounds/division",
            hint=f"they must hold 1/{links}",
        )
    # the extreme shares of a box of log-ratios +-r: 1 / (1 + e^r + (n - 2) e^r) at least, the mirror image at
    # most
    smallest = np.log((1.0 / low - 1.0) / (links - 1)) if low > 0 else RATIO_RANGE
    largest = np.log((links - 1) / (1.0 / high - 1.0)) if high < 1 else RATIO_RANGE
    return float(min(RATIO_RANGE, smallest / 2, largest / 2))


def _check_bound(name: str, pair: Sequence[float]) -> None:
    pointer = f"/model/bounds/{name}"
    if name not in BOUND_NAMES:
        raise InvalidInput(f"{name} has no bounds", pointer=pointer, hint=f"use {', '.join(BOUND_NAMES)}")
    low, high = pair
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InvalidInput(f"{name} is bounded by {low:g}..{high:g}", pointer=pointer, hint="give low < high")
    if name in ("stiffness_nm_rad", "damping_nms_rad", "lag_s", "lift_factor") and low <= 0:
        raise InvalidInput(
            f"the lower bound of {name} is {low:g}", pointer=pointer, hint="it must be greater than 0"
        )
    if name in ("profile_drag", "division") and low < 0:
        raise InvalidInput(
            f"the lower bound of {name} is {low:g}", pointer=pointer, hint="it must not be negative"
        )
    if low > 0 and np.log10(high / low) > LARGEST_DECADES:
        raise InvalidInput(
            f"the bounds of {name} span more than {LARGEST_DECADES:g} decades",
            pointer=pointer,
            hint="narrow them",
        )
