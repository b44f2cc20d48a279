"""The identifiable parameters for documents: names, and ranges of bounds and values.

The implementation of a parameter is under the same name in ``morphcore/models/parameters.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field


@dataclass(frozen=True)
class Identifiable:
    """Facts about one parameter.

    Attributes
    ----------
    name : str
        Name in bounds, corrections and reports.
    low, high : float
        Physical range of its bounds, SI units.
    positive : bool
        Whether it is searched on a logarithmic scale, so that zero is not a valid bound.
    bounds_description : str, optional
        Of its bounds.
    value : type, optional
        For an aerodynamic correction, its type in a model's ``aero`` object; None: not a correction.
    default : float, optional
        Value of a correction that a document omits; None: required, or `own_default`.
    own_default : bool
        Whether a document may omit it, which leaves it as the aircraft has it.
    on_request : bool
        Whether it is searched only where a request lists it or gives its bounds.
    value_description : str, optional
        Of a correction's value.
    apart_description : str, optional
        Of its values by surface, where unlike surfaces may have their own.
    """

    name: str
    low: float
    high: float
    positive: bool = False
    bounds_description: str | None = None
    value: Any = None
    default: float | None = None
    own_default: bool = False
    on_request: bool = False
    value_description: str | None = None
    apart_description: str | None = None


IDENTIFIABLE: list[Identifiable] = [
    Identifiable("stiffness_nm_rad", 0.0, 1e12, positive=True),
    Identifiable("damping_nms_rad", 0.0, 1e10, positive=True),
    Identifiable("division", 0.0, 1.0, bounds_description="[low, high] of a link's share of the span."),
    Identifiable(
        "lift_factor",
        0.0,
        10.0,
        positive=True,
        value=Annotated[float, Field(gt=0.0, le=100.0)],
        default=1.0,
        value_description="Of all surfaces that `lift_factors` does not name.",
        apart_description="Lift factors of surfaces that have their own, mirror images by a name for both.",
    ),
    Identifiable(
        "ac_offset_m",
        -50.0,
        50.0,
        value=Annotated[float, Field(ge=-100.0, le=100.0)],
        default=0.0,
        value_description="Forward positive.",
    ),
    Identifiable("profile_drag", 0.0, 2.0, value=Annotated[float, Field(ge=0.0, le=10.0)]),
    Identifiable("lag_s", 0.0, 10.0, positive=True, value=Annotated[float, Field(ge=0.0, le=100.0)]),
    Identifiable(
        "zero_lift_rad",
        -0.35,
        0.35,
        value=Annotated[float, Field(ge=-0.35, le=0.35)],
        own_default=True,
        on_request=True,
        value_description="Zero-lift angle of attack of the sections; left out: the aircraft's.",
    ),
    Identifiable(
        "cm0",
        -0.5,
        0.5,
        value=Annotated[float, Field(ge=-0.5, le=0.5)],
        own_default=True,
        on_request=True,
        value_description="Moment coefficient of the sections, nose up positive; left out: the aircraft's.",
    ),
]


def corrections() -> tuple[str, ...]:
    """Return the names of the aerodynamic corrections."""
    return tuple(each.name for each in IDENTIFIABLE if each.value is not None)


def on_request() -> tuple[str, ...]:
    """Return the names of the corrections that are searched only where a request names them."""
    return tuple(each.name for each in IDENTIFIABLE if each.on_request)
