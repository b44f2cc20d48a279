"""The unknowns of an identification: which parameters of which surfaces, and the box they are searched in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.models.equivalent import ChainModel, ParameterBatch, fitted, physical_guess
from morphcore.models.parameters import Parameter
from morphcore.models.surface_rows import CutSurface
from morphcore.models.transforms import Transform
from morphcore.search.solver import Box
from morphdata.faults import refuse
from morphdata.identify import Bounds
from morphdata.links import LinksPerWing, by_pair
from morphdata.renamed import current_name, current_names

Array = NDArray[np.float64]
Interval = tuple[float | None, float | None]

BOUND_TOLERANCE = 1e-3  # of the box's width; half a per cent of a stiffness
WARM_START = "/search/warm_start"  # where a request says what to begin from


@dataclass(frozen=True)
class Unknown:
    """One parameter of one surface, of a mirror pair or of the aircraft.

    Attributes
    ----------
    parameter : Parameter
        Its kind.
    links : int
        Of the surfaces that have it.
    prefix : str
        Of its names; "" where there is no other of its kind.
    sets : tuple of int
        Sets of a batch that have it, or columns of the lift factor; none where the aircraft has one.
    surfaces : tuple of int
        Indices of the surfaces that have it; none where the aircraft has one.
    transform : Transform
        How it is searched.
    lower, upper, guess : ndarray, shape (d,)
        Box and physical guess in search coordinates; d = 0 where it is fixed.
    limits : tuple of two ndarrays, shape (d,)
        How far a search may widen the box: bounds that were asked for stay as they are.
    """

    parameter: Parameter
    links: int
    prefix: str
    sets: tuple[int, ...]
    surfaces: tuple[int, ...]
    transform: Transform
    lower: Array
    upper: Array
    guess: Array
    limits: tuple[Array, Array]

    @property
    def searched(self) -> bool:
        """Whether it is searched, and not fixed."""
        return self.guess.size > 0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its m values."""
        return tuple(f"{self.prefix}{name}" for name in self.parameter.names(self.links))

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        """Names of its d search coordinates; none where it is fixed."""
        names = self.parameter.coordinate_names(self.links) if self.searched else ()
        return tuple(f"{self.prefix}{name}" for name in names)

    def of(self, batch: ParameterBatch) -> Array:
        """Its values (p, m) in a batch."""
        name = self.parameter.name
        values = batch.of_set(name, self.sets[0]) if self.sets else batch[name]
        return values.reshape(batch.particles, -1)


@dataclass(frozen=True)
class SearchSpace:
    """Box of search coordinates and the way from them to parameters.

    Attributes
    ----------
    model : ChainModel
    unknowns : tuple of Unknown
        In the order of coordinates and reports, fixed ones included.
    free_aero : tuple of str
        Names of the corrections that are searched.
    fixed : ParameterBatch
        The values (one particle) of all that is not.
    """

    model: ChainModel
    unknowns: tuple[Unknown, ...]
    free_aero: tuple[str, ...]
    fixed: ParameterBatch = field(repr=False)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """What each coordinate stands for."""
        return tuple(name for unknown in self.unknowns for name in unknown.coordinate_names)

    @cached_property
    def lower(self) -> Array:
        """(d,) lower bounds."""
        return np.concatenate([unknown.lower for unknown in self.unknowns])

    @cached_property
    def upper(self) -> Array:
        """(d,) upper bounds."""
        return np.concatenate([unknown.upper for unknown in self.unknowns])

    @property
    def box(self) -> Box:
        """The bounds."""
        return Box(self.lower, self.upper)

    @cached_property
    def limits(self) -> Box:
        """How far the box may be widened, (d,) each."""
        return Box(
            np.concatenate([unknown.limits[0] for unknown in self.unknowns]),
            np.concatenate([unknown.limits[1] for unknown in self.unknowns]),
        )

    def widened(self, box: Box) -> SearchSpace:
        """The same unknowns in another box (d,)."""
        unknowns = tuple(
            replace(unknown, lower=box.lower[at], upper=box.upper[at]) for unknown, at, _ in self._parts()
        )
        return replace(self, unknowns=unknowns)

    @cached_property
    def guess(self) -> Array:
        """(d,) the physical guess."""
        return np.concatenate([unknown.guess for unknown in self.unknowns])

    @property
    def dimension(self) -> int:
        """Number of unknowns d."""
        return int(self.guess.size)

    @property
    def links(self) -> LinksPerWing:
        """Links per wing."""
        return self.model.links_per_wing

    def _parts(self) -> Iterator[tuple[Unknown, slice, slice]]:
        """All unknowns with their places among the coordinates and among the named values."""
        x, named = 0, 0
        for unknown in self.unknowns:
            d, m = unknown.guess.size, len(unknown.names)
            yield unknown, slice(x, x + d), slice(named, named + m)
            x, named = x + d, named + m

    def decode(self, x: Array) -> ParameterBatch:
        """Parameters of search points (p, d)."""
        x = np.atleast_2d(x)
        values = {name: np.repeat(value, x.shape[0], axis=0) for name, value in self.fixed.values.items()}
        batch = replace(self.fixed, values=values)
        for unknown, at, _ in self._parts():
            if unknown.searched:
                found, name = unknown.transform.inverse(x[:, at]), unknown.parameter.name
                places = [batch.of_set(name, k) for k in unknown.sets] or [values[name]]
                for out in places:
                    out[:] = found.reshape(out.shape)
        return batch

    def encode(self, batch: ParameterBatch) -> Array:
        """The search point (d,) of a model (one particle), moved into the bounds.

        Corrections that are not searched keep their fixed values.

        Raises
        ------
        InvalidInput
            It has other links than are searched, wings of their own where mirror images are searched alike,
            or other surfaces.
        """
        try:
            batch = fitted(self.model, batch)
        except InvalidInput as error:
            raise InvalidInput(error.message, pointer=WARM_START, hint=error.hint) from None
        chosen = self.model.set_of(batch)
        x = self.guess.copy()
        for unknown, at, _ in self._parts():
            name = unknown.parameter.name
            if not unknown.searched or name not in batch.values:
                continue
            if unknown.parameter.scope == "aircraft":
                reference = self.model.aircraft.surfaces.index(self.model.reference_surface)
                number = unknown.surfaces[0] if unknown.surfaces else reference
                values = batch.of_aircraft(name, self.model.own_column(batch, number))
            else:
                given = {chosen[k] for k in unknown.surfaces}
                if len(given) > 1 and unknown.parameter.scope == "surface":
                    raise InvalidInput(
                        "the search would begin from a model whose wings have parameters of their own",
                        pointer=WARM_START,
                        hint="set model.separate_wings, or begin from a model whose wings are alike",
                    )
                values = batch.of_set(name, min(given))[0]
            x[at] = unknown.transform.forward(values.reshape(-1))
        return np.asarray(np.clip(x, self.lower, self.upper))

    def flatten(self, batch: ParameterBatch) -> Array:
        """Named parameters in SI units (p, m), ordered as ``parameter_names``, fixed ones included."""
        return np.concatenate([unknown.of(batch) for unknown in self.unknowns], axis=1)

    @cached_property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the columns of ``flatten``."""
        return tuple(name for unknown in self.unknowns for name in unknown.names)

    @cached_property
    def searched(self) -> NDArray[np.bool_]:
        """(m,) which named parameters are searched; the others are fixed."""
        return np.array([unknown.searched for unknown in self.unknowns for _ in unknown.names])

    @property
    def parameter_limits(self) -> Array:
        """(m, 2) smallest and largest value of each named parameter within the box, SI units."""
        box = np.repeat(self.flatten(self.fixed).T, 2, axis=1)
        for unknown, _, named in self._parts():
            if unknown.searched:
                box[named] = np.stack(unknown.transform.limits(unknown.lower, unknown.upper), axis=1)
        return box

    def interval_rates(self, values: Array) -> Array:
        """(m,) how fast the coordinate in which an interval is even changes with its value; 0 of fixed ones.

        values : (m,) of the named parameters, SI units.
        """
        rates = np.zeros(values.shape)
        for unknown, _, named in self._parts():
            if unknown.searched:
                rates[named] = unknown.transform.derivative(values[named])
        return rates

    def intervals(self, values: Array, half: Array, at_bound: Mapping[str, str]) -> dict[str, Interval]:
        """Interval of each searched parameter: its ends where the half widths (m,), in coordinates, put them.

        A side that ends beyond the box, or at whose bound the parameter lies, is not bounded by the samples.
        """
        found = {}
        limits = self.parameter_limits
        for unknown, _, named in self._parts():
            if not unknown.searched:
                continue
            ends = np.stack(unknown.transform.interval(values[named], half[named]), axis=1)
            for name, (low, high), (minimum, maximum) in zip(unknown.names, ends, limits[named], strict=True):
                inside = low >= minimum and at_bound.get(name) != "lower"
                below = high <= maximum and at_bound.get(name) != "upper"
                found[name] = (float(low) if inside else None, float(high) if below else None)
        return found

    def at_bound(self, x: Array) -> dict[str, str]:
        """Named parameters whose search coordinate in x (d,) lies at its bound, and which: "lower", "upper".

        A link's length is searched as its ratio to the last link's, and stands for that ratio here.
        """
        near = BOUND_TOLERANCE * (self.upper - self.lower)
        ends = np.select([x <= self.lower + near, x >= self.upper - near], ["lower", "upper"], "")
        return {
            name: str(end)
            for unknown, at, _ in self._parts()
            for name, end in zip(unknown.names, ends[at], strict=False)  # the last share has no coordinate
            if end
        }

    def bound_coordinates(self, x: Array) -> NDArray[np.int64]:
        """Indices of the coordinates of x (d,) that lie at their bounds."""
        near = BOUND_TOLERANCE * (self.upper - self.lower)
        return np.flatnonzero((x <= self.lower + near) | (x >= self.upper - near))

    def named(self, chosen: NDArray[np.bool_]) -> tuple[str, ...]:
        """Named parameters of some search coordinates (d,); a share of the span stands for its ratio."""
        return tuple(
            name
            for unknown, at, _ in self._parts()
            for name, is_chosen in zip(unknown.names, chosen[at], strict=False)  # the last share has none
            if is_chosen
        )

    def parameter(self, name: str) -> Parameter:
        """The kind of a named parameter; its former name is accepted, too."""
        name = current_name(name)
        return next(unknown.parameter for unknown in self.unknowns if name in unknown.names)


def search_space(
    model: ChainModel,
    *,
    separate_wings: bool = False,
    aero_coefficients: Sequence[str] | None = None,
    bounds: Mapping[str, Sequence[float]] | None = None,
    own_lift: Sequence[str] | None = (),
) -> SearchSpace:
    """The unknowns of a model, bounded around beam and thin-airfoil theory.

    Parameters
    ----------
    model : ChainModel
    separate_wings : bool
        Whether both surfaces of a mirror pair have parameters of their own.
    aero_coefficients : sequence of str, optional
        The corrections to search; None: all, those on request only if they have bounds.
    bounds : mapping of str to (float, float), optional
        Low and high in SI units, by the name of a parameter, in the place of its own.
    own_lift : sequence of str, optional
        Surfaces that have a lift factor of their own, the others share one; None: all have.

    Raises
    ------
    InvalidInput
        A surface or bound is unknown, empty, of the wrong sign or absurdly wide, or a correction is unknown.
    """
    given_bounds = Bounds.parse(
        {name: list(pair) for name, pair in (bounds or {}).items()}, "/model/bounds"
    ).given()
    corrections = [parameter.name for parameter in model.parameters if parameter.correction]
    for index, name in enumerate(aero_coefficients or ()):
        if current_name(name) not in corrections:
            raise InvalidInput(
                f"{name!r} is not an aerodynamic correction",
                pointer=f"/model/aero_coefficients/{index}",
                hint=f"use some of {', '.join(corrections)}",
            )
    chosen = (
        [p.name for p in model.parameters if p.name in given_bounds or not p.on_request]
        if aero_coefficients is None
        else current_names(aero_coefficients)
    )
    free = tuple(name for name in corrections if name in chosen)
    apart = own_lift_of(model, own_lift) if "lift_factor" in free else ()
    fixed = physical_guess(model, separate_wings=separate_wings, apart=apart)
    unknowns = []
    for parameter in model.parameters:
        owners = _owners(model, parameter, apart, separate_wings=separate_wings)
        for column, (prefix, surfaces) in enumerate(owners):
            searched = parameter.name in free or not parameter.correction
            given = given_bounds.get(parameter.name) if searched else None
            sets = _sets(model, fixed, parameter, column, surfaces)
            unknowns.append(
                _unknown(model, fixed, (parameter, prefix, sets, surfaces), given, searched=searched)
            )
    return SearchSpace(model=model, unknowns=tuple(unknowns), free_aero=free, fixed=fixed)


def own_lift_of(model: ChainModel, names: Sequence[str] | None) -> tuple[str, ...]:
    """Keys of `ChainModel.unlike` whose lift factor is searched apart; None stands for all.

    The largest of all has the one without a name.
    """
    keys = tuple(model.unlike)
    if names is None:
        return keys[1:]
    surfaces = [surface.name for surface in model.aircraft.surfaces]
    pairs = [*model.unlike.values()]
    found, faults = by_pair(dict.fromkeys(names, True), surfaces, pairs, "/model/own_lift")
    refuse(faults)
    return keys[1:] if len(found) == len(keys) else tuple(keys[number] for number in sorted(found))


def _owners(
    model: ChainModel, parameter: Parameter, apart: Sequence[str], *, separate_wings: bool
) -> list[tuple[str, tuple[int, ...]]]:
    """Who has values of a parameter of its own: prefix of the names, and indices of the surfaces."""
    if parameter.apart and apart:
        shared = tuple(k for key, pair in model.unlike.items() if key not in apart for k in pair)
        return [("", shared), *((f"{key}.", model.unlike[key]) for key in apart)]
    if parameter.scope == "aircraft":
        return [("", ())]
    separate = separate_wings and parameter.scope == "surface"
    groups = model.sets(separate_wings=separate)
    if len(groups) == 1:
        return [("", groups[0])]
    if len(model.pairs) == 1:
        return [(f"wing_{number}.", group) for number, group in enumerate(groups, start=1)]
    return [(f"{model.label(group)}.", group) for group in groups]


def _sets(
    model: ChainModel, fixed: ParameterBatch, parameter: Parameter, column: int, surfaces: tuple[int, ...]
) -> tuple[int, ...]:
    """Sets of a batch, or columns of its lift factor, that an owner has."""
    if parameter.scope == "aircraft":
        return (column,) if surfaces else ()
    chosen = model.set_of(fixed)
    return tuple(sorted({chosen[k] for k in surfaces}))


def _unknown(
    model: ChainModel,
    fixed: ParameterBatch,
    owned: tuple[Parameter, str, tuple[int, ...], tuple[int, ...]],
    bounds: Sequence[float] | None,
    *,
    searched: bool,
) -> Unknown:
    parameter, prefix, sets, surfaces = owned
    surface = model.aircraft.surfaces[surfaces[0]] if surfaces else model.reference_surface
    own = 0 if parameter.scope == "aircraft" else sets[0]
    values = (fixed.of_set(parameter.name, sets[0]) if sets else fixed[parameter.name])[0].reshape(-1)
    transform = parameter.transform(surface)
    lower = upper = np.zeros(0)
    limits = (lower, upper)
    if searched and bounds is not None:
        low, high = bounds
        lower, upper = limits = transform.box(low, high, values.size)
    elif searched:
        cut = CutSurface(surface, model.flight, fixed.of_set("division", own))
        lower, upper = parameter.bounds(cut)
        limits = _limits(parameter, cut, lower, upper)
    guess = transform.forward(values) if lower.size else lower
    # no damping at all has no logarithm: its search begins in the middle
    guess = np.where(np.isfinite(guess), guess, 0.5 * (lower + upper))
    guess = np.clip(guess, lower, upper)
    links = fixed.of_set("division", own).shape[1]
    return Unknown(parameter, links, prefix, sets, surfaces, transform, lower, upper, guess, limits)


def _limits(parameter: Parameter, cut: CutSurface, lower: Array, upper: Array) -> tuple[Array, Array]:
    """How far the box of a parameter may be widened: nowhere less than it is."""
    if parameter.limits is None:
        return lower, upper
    lowest, highest = parameter.limits(cut)
    return np.minimum(lower, lowest), np.maximum(upper, highest)
