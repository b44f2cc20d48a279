"""Parameters of a batch of equivalent models of one aircraft."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from morphcore.shown import Shown
from morphdata.links import LinksPerWing, links_document
from morphdata.renamed import RENAMED, current_name

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class ParameterBatch(Shown):
    """Parameters of a batch of equivalent models of one aircraft (p particles, w sets, n links).

    Attributes
    ----------
    values : mapping of str to ndarray
        Keyed by the names of ``CHAIN_PARAMETERS``. Each set has ``division`` (p, w, n), shares of the span
        that sum to one; ``stiffness_nm_rad`` and ``damping_nms_rad`` (p, w, n - 1, 3) of flap, torsion and
        edgewise; ``profile_drag`` (p, w). The aircraft has ``lift_factor``, ``ac_offset_m`` (forward
        positive) and ``lag_s`` (p,): values of its largest surface; other surfaces scale them with their
        chords. ``lift_factor`` (p, 1 + a) has further columns, of the surfaces named in ``apart``.
    surfaces : tuple of tuples of str, optional
        Names of the surfaces of each set. None: a single set belongs to all flexible surfaces, which form one
        mirror pair; several sets belong to the flexible surfaces in the aircraft's order.
    set_links : tuple of int, optional
        Links of each set, where they differ; n is the most of them, and what a set lacks is zero.
    apart : tuple of str
        Surfaces, or words for mirror pairs, that have a lift factor of their own.
    """

    values: Mapping[str, Array]
    surfaces: tuple[tuple[str, ...], ...] | None = None
    set_links: tuple[int, ...] | None = None
    apart: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if any(name in RENAMED for name in self.values):
            current = {current_name(name): value for name, value in self.values.items()}
            object.__setattr__(self, "values", current)

    def __getitem__(self, name: str) -> Array:
        """The values of one parameter; its former name is also accepted."""
        return self.values[current_name(name)]

    @property
    def particles(self) -> int:
        """Number of parameter sets."""
        return int(self["division"].shape[0])

    @property
    def sets(self) -> int:
        """Number of sets of surface values, w."""
        return int(self["division"].shape[1])

    @property
    def links(self) -> int:
        """Links per flexible surface, the most where they differ."""
        return int(self["division"].shape[2])

    @property
    def links_per_wing(self) -> LinksPerWing:
        """Links per flexible surface, by name where they differ."""
        if self.set_links is None or self.surfaces is None:
            return self.links
        names = [name for group in self.surfaces for name in group]
        counts = [n for n, group in zip(self.set_links, self.surfaces, strict=True) for _ in group]
        return links_document(names, counts)

    def of_set(self, name: str, number: int) -> Array:
        """A view of one set's values (p, ...) of a parameter, of as many links or joints as it has."""
        values = self[name][:, number]
        if self.set_links is None or values.ndim == 1:
            return values
        return values[:, : values.shape[1] - self.links + self.set_links[number]]

    def of_aircraft(self, name: str, column: int = 0) -> Array:
        """Values (p,) of a parameter of the aircraft: the shared ones, or those of a later column."""
        values = self[name]
        return values if values.ndim == 1 else values[:, column]

    def select(self, index: NDArray[np.int64] | slice) -> ParameterBatch:
        """Return a subset of the particles."""
        return replace(self, values={name: value[index] for name, value in self.values.items()})

    def changed(self, **values: Array) -> ParameterBatch:
        """Return a copy with other values of some parameters.

        Raises
        ------
        KeyError
            A name is not one of its parameters.
        """
        values = {current_name(name): value for name, value in values.items()}
        if not values.keys() <= self.values.keys():
            raise KeyError(f"got {', '.join(values)}, but the parameters are {', '.join(self.values)}")
        return replace(self, values={**self.values, **values})


def together(values: list[Array]) -> Array:
    """Values (p, w, ...) of all sets from those of each (p, ...); what has fewer links ends in zeros."""
    if values[0].ndim > 1:
        most = max(each.shape[1] for each in values)
        widths = [(0, 0) for _ in range(values[0].ndim)]
        values = [np.pad(each, [(0, 0), (0, most - each.shape[1]), *widths[2:]]) for each in values]
    return np.stack(values, axis=1)
