"""An identified model on the screen: every parameter, its unit in its name, with its interval."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.table import Table

from morphdata.links import shown_per_wing
from morphdata.renamed import current_name, current_names
from morphid.screen import new_table, short

Document = Mapping[str, Any]

AXES = ("flap", "torsion", "edgewise")
JOINTS = ("stiffness_nm_rad", "damping_nms_rad")


def named_parameters(model: Document) -> Iterator[tuple[str, float]]:
    """Give the parameters of a model by the names that its uncertainty has, in their order."""
    named = {f"{name}.": own for name, own in (model.get("surfaces") or {}).items() if "mirror_of" not in own}

    def wings(name: str) -> Sequence[tuple[str, Any]]:
        if named:
            return [(prefix, own[name]) for prefix, own in named.items()]
        separate, values = model.get("separate_wings"), model[name]
        return [(f"wing_{i}.", own) for i, own in enumerate(values, 1)] if separate else [("", values)]

    for wing, shares in wings("division"):
        yield from ((f"{wing}division.{k}", share) for k, share in enumerate(shares, 1))
    for name in JOINTS:
        for wing, joints in wings(name):
            for j, joint in enumerate(joints, 1):
                # one number for all three axes is allowed, too
                values = joint if isinstance(joint, Sequence) else [joint] * len(AXES)
                for axis, value in zip(AXES, values, strict=True):
                    yield f"{wing}{name}.joint_{j}.{axis}", value
    own_corrections = set.intersection(*map(set, named.values())) if named else set()
    aero = {current_name(name): value for name, value in model["aero"].items()}
    apart = aero.pop("lift_factors", None) or {}
    for name, value in aero.items():
        yield from (
            ((f"{wing}{name}", own) for wing, own in wings(name))
            if name in own_corrections
            else [(name, value)]
        )
        if name == "lift_factor":
            yield from ((f"{surface}.{name}", own) for surface, own in apart.items())


def model_table(result: Document) -> Table:
    """Show every parameter with its Cramer-Rao bound and its 95 % interval.

    Grey are those that the samples do not determine.
    """
    model, uncertainty = result["model"], result.get("uncertainty") or {}
    intervals = {current_name(name): ends for name, ends in (uncertainty.get("interval_95") or {}).items()}
    unseen = current_names(uncertainty.get("undetermined") or ())
    bound = current_names(uncertainty.get("at_bound") or ())
    title = f"Equivalent model, {shown_per_wing(model['links_per_wing'])}"
    bounds = {
        current_name(name): each for name, each in (uncertainty.get("cramer_rao_percent") or {}).items()
    }
    captions = ["CR: Cramer-Rao bound, for white residuals"] * bool(bounds)
    captions += ["grey: the samples do not determine it"] * bool(unseen)
    table = new_table(
        *("parameter", "value", "CR %", "95 % interval"), title=title, caption="; ".join(captions) or None
    )
    for name, value in named_parameters(model):
        known = name in intervals
        notes = ["unseen"] * (name in unseen) + ["bound"] * (name in bound)
        # notes in a column of their own would not fit into 80 characters
        words = [shown_interval(intervals[name]), *notes] if known else ["fixed"] * bool(intervals)
        table.add_row(
            name,
            short(value),
            percent(bounds.get(name)),
            " ".join(words or notes),
            style="dim" if name in unseen else None,
        )
    return table


def percent(bound: float | None) -> str:
    """Give a Cramer-Rao bound; one beyond the value itself says no more than that."""
    if bound is None:
        return ""
    return ">1e3" if bound > 1e3 else f"{bound:.2g}" if bound < 1e2 else f"{bound:.0f}"


def shown_interval(interval: Sequence[float | None]) -> str:
    """Give an interval in words; a side that is not bounded is left open."""
    low, high = interval
    if low is None and high is None:
        return "open"
    if low is None:
        return f"up to {short(high)}"
    return f"from {short(low)}" if high is None else f"{short(low)} to {short(high)}"


def at_bound_line(result: Document) -> str:
    """Give a line that lists the parameters that ended at a bound of the search; "" without any."""
    names = current_names((result.get("uncertainty") or {}).get("at_bound") or ())
    return f"At a bound of the search: {', '.join(names)}" if names else ""
