"""Inertia of a rigid body as documents give it, and whether a body can have it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated

from pydantic import Field

from morphdata.faults import Fault

ROUND_OFF = 1e-9  # relative tolerance of the terms of an inertia

Moment = Annotated[float, Field(ge=-1e12, le=1e12)]
Row3 = Annotated[list[Moment], Field(min_length=3, max_length=3)]
Inertia = (
    Annotated[list[Moment], Field(min_length=3, max_length=3)]
    | Annotated[list[Row3], Field(min_length=3, max_length=3)]
)
Matrix3 = list[list[float]]


def inertia_matrix(given: Sequence[float | list[float]]) -> Matrix3:
    """Return the 3 x 3 matrix of an inertia given as a matrix or by its diagonal."""
    return [
        row if isinstance(row, list) else [row if column == number else 0.0 for column in range(3)]
        for number, row in enumerate(given)
    ]


def inertia_faults(given: Sequence[float | list[float]] | None) -> Iterator[Fault]:
    """Check that an inertia, if given, is that of a body."""
    if given is not None and not _is_inertia(inertia_matrix(given)):
        yield Fault(
            "inertia_not_physical",
            "This matrix is not the inertia of a body: it must be symmetric and positive definite, and "
            "no principal moment may exceed the sum of the other two.",
            "/inertia_kg_m2",
            "Check signs and symmetry; products of inertia enter with their minus sign.",
        )


def _is_inertia(m: Matrix3) -> bool:
    """Whether a matrix is symmetric, positive definite and satisfies the triangle inequality.

    Moments of inertia are J = tr(P) - P with the second moments P of the mass, which are not negative.
    """
    scale = max(abs(term) for row in m for term in row) or 1.0
    if any(abs(m[i][j] - m[j][i]) > ROUND_OFF * scale for i in range(3) for j in range(i)):
        return False
    half = (m[0][0] + m[1][1] + m[2][2]) / 2.0 + ROUND_OFF * scale
    return _is_positive(m) and _is_positive(
        [[(half if i == j else 0.0) - m[i][j] for j in range(3)] for i in range(3)]
    )


def _is_positive(m: Matrix3) -> bool:
    """Whether a symmetric matrix is positive definite, by Sylvester's leading minors."""
    first = m[0][0]
    second = m[0][0] * m[1][1] - m[0][1] * m[1][0]
    third = (
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1])
        - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
        + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    )
    return first > 0.0 and second > 0.0 and third > 0.0
