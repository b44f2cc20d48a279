"""The first and the last sections: what came out, what differs from the paper and why, what made it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from morphcore.paper.asked import Asked, batch_share, flight_share, held_out_ratios
from morphcore.paper.report.html import (
    NOTHING,
    Column,
    Section,
    bullets,
    minutes,
    number,
    paragraph,
    percent,
    section,
    signed_percent,
    table,
    words,
)
from morphcore.paper.report.morph_section import change
from morphcore.paper.scenario import (
    PAPER_COMPUTATION,
    PAPER_OPTIMUM,
    PAPER_RIGID_OPTIMUM,
)
from morphcore.paper.settings import PaperSettings
from morphcore.paper.stages import Finished, Results

Document = dict[str, Any]

LEAST_PLAIN = 1e-4  # smaller limits are written with a power of ten
ALIKE_RAD = 0.05  # schedules no further apart are called nearly one


def summary_section(results: Results, asked: Sequence[Asked]) -> Section:
    """The paper's headlines beside ours, then every asked figure."""
    missed = sum(each.met is False for each in asked)
    verdict = "All of them are met" if not missed else f"{missed} of {len(asked)} are missed"
    return section(
        "summary",
        "What came out",
        _headlines(results),
        paragraph(
            f"What was asked of this reproduction, and what this run measured. {verdict}; the verdicts are "
            "computed from the figures."
        ),
        _asked_table(asked),
    )


def _headlines(results: Results) -> str:
    first = results["computation"]["flights"][0]
    ratios = [value for value in held_out_ratios(results["identification"]).values() if value is not None]
    alone, whole = (percent(flight_share(first, "equivalent", part)) for part in ("fly_s", "total_s"))
    in_batch = percent(batch_share(results["computation"]))
    rows = [
        (
            "accuracy of the equivalent model on flights held out",
            "as the flexible model",
            f"J at most {number(max(ratios, default=None))} of the rigid model's",
        ),
        (
            "computation of an equivalent flight, of the flexible one's",
            f"about {PAPER_COMPUTATION:g} %",
            f"{alone} ({whole} with lattice and trim; {in_batch} in a batch)",
        ),
        (
            "attitude variation of the optimised morph against constant rate",
            signed_percent(PAPER_OPTIMUM),
            signed_percent(change(results, "optimum")),
        ),
        (
            "the same of the morph optimised with the rigid model",
            signed_percent(PAPER_RIGID_OPTIMUM),
            signed_percent(change(results, "rigid_optimum")),
        ),
    ]
    return table(
        "", "The paper's headlines and ours.", [words("what"), words("the paper"), words("this run")], rows
    )


def _asked_table(asked: Sequence[Asked]) -> str:
    verdicts = {True: "met", False: "missed", None: "not measured"}
    rows = [
        (
            each.what,
            f"{'≥' if each.at_least else '≤'} {_limit(each.limit)} {each.unit}".strip(),
            NOTHING if each.value is None else f"{number(each.value)} {each.unit}".strip(),
            verdicts[each.met],
        )
        for each in asked
    ]
    columns = [words("figure"), Column("asked"), Column("measured"), Column("", "verdict")]
    return table("", "Asked, measured, met.", columns, rows)


def _limit(value: float) -> str:
    return f"{value:g}" if value >= LEAST_PLAIN else number(value)


def differences_section(settings: PaperSettings, results: Results) -> Section:
    """What differs from the paper, and why."""
    return section(
        "differences",
        "What differs from the paper, and why",
        paragraph(
            "The paper's printed tables and equations were not at hand; "
            "its method and headline figures were. Where its figures are missing in the tables above, that "
            "is why."
        ),
        bullets(list(_differences(settings, results))),
    )


def _differences(settings: PaperSettings, results: Results) -> Iterator[str]:
    yield (
        "The aircraft's density, modulus, damping and speed are ours. Ratios between models carry over from "
        "one such aircraft to another in kind, not in digits."
    )
    yield (
        "The truth is our own flexible model. It shares its lattice with the equivalent model and nothing of "
        "its structural dynamics, so the small J of the identified model shows what rigid links can do for a "
        "bending wing, not how well any vortex lattice predicts an aircraft."
    )
    if results["independent"]["available"]:
        yield (
            "How far the truth itself can be trusted is shown on another program's flights, predicted with "
            "nothing fitted."
        )
    yield (
        "The identification is polished by least squares from several starts. The paper's swarm was run "
        "beside it on the same flights; its J stands in the table of searches."
    )
    yield (
        "The rate of the optimised morph is limited and the attitude counts for some time after it. The "
        "paper's text names neither: without them the best morph is to wait and snap, whatever the model."
    )
    yield _rigid_sentence(results)
    if settings.quick:
        yield (
            "This is the quick form: fewer links in the study, a small swarm, fewer repetitions, and a step "
            "of the flexible model twice as long (the table of convergence shows what that changes)."
        )


def _rigid_sentence(results: Results) -> str:
    own, rigid = change(results, "optimum"), change(results, "rigid_optimum")
    schedules = results["morph"]["curves"]["schedules"]
    if own is None or rigid is None:
        return "The rigid model's optimum could not be flown in the flexible model."
    apart = np.abs(np.subtract(schedules["optimum"]["sweep_rad"], schedules["rigid_optimum"]["sweep_rad"]))
    said = (
        f"The rigid model's optimum changes the variation by {signed_percent(rigid)}, the equivalent one's "
        f"by {signed_percent(own)}; the two schedules are {number(float(apart.max()), 2)} rad apart at most. "
    )
    if apart.max() < ALIKE_RAD:
        return said + (
            "They are nearly one: turn as late as the rate limit allows. Here the limit decides more than "
            "the model does, where the paper's rigid optimum made the flight worse than constant rate."
        )
    return said + "The bending of the wings decides which schedule is calm."


def provenance_section(settings: PaperSettings, finished: Mapping[str, Finished]) -> Section:
    """Versions, machine, seed, and the time of every stage."""
    where = list(finished.values())[-1].where
    machine, versions = where["machine"], where["versions"]
    core = settings.lattice.core
    facts = [
        ("seed of all searches", str(settings.seed)),
        ("form", "quick" if settings.quick else "full"),
        ("vortex core of all three models", f"“{core.law}”, {core.radius_fraction:g}"),
        ("processor", f"{machine['processor']}, {machine['cores']} cores, {machine['threads']} threads used"),
        ("system", str(machine["system"])),
        ("versions", ", ".join(f"{name} {version}" for name, version in versions.items())),
    ]
    rows = [
        (
            name,
            minutes(done.wall_s),
            done.finished_at.replace("+00:00", " UTC").replace("T", " "),
            done.key[:12],
        )
        for name, done in finished.items()
    ]
    rows.append(("together", minutes(total_s(finished)), "", ""))
    return section(
        "provenance",
        "What made this report",
        table("", "Settings, machine and versions.", [words("what"), words("value")], facts),
        table(
            "",
            "Stages: wall time in all runs that they took, when they ended, and the key of their inputs.",
            [words("stage"), Column("time"), words("ended"), words("key")],
            rows,
            strong=[len(rows) - 1],
        ),
    )


def total_s(finished: Mapping[str, Finished]) -> float:
    """Wall time of all stages, s."""
    return sum(done.wall_s for done in finished.values())
