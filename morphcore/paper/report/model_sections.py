"""The sections on the equivalent model: Table 1, figures 4 to 9, and Table 2."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from morphcore.export.paper_plots import search_figure, verification_figure
from morphcore.export.study_plots import study_figure
from morphcore.paper.asked import (
    BATCH_PERCENT,
    FLIGHT_PERCENT,
    HELD_OUT_RATIO,
    batch_share,
    flight_share,
    held_out_ratios,
    ratio,
)
from morphcore.paper.report.html import (
    NOTHING,
    Column,
    Section,
    figure,
    heading,
    milliseconds,
    minutes,
    mrad,
    number,
    paragraph,
    percent,
    prettified,
    section,
    table,
    words,
)
from morphcore.paper.scenario import LINKS, PAPER_COMPUTATION, paper_flights
from morphcore.paper.stages import Results

Document = dict[str, Any]

COMMON_FLIGHT = "rate_0.5"  # also among the independent program's
FIRST_FITTED, FIRST_CHECK = 4, 7  # numbers of the paper's figures


def study_section(results: Results) -> Section:
    """Table 1: how many links."""
    found = results["study"]
    recommended = found["recommended"]
    return section(
        "links",
        "Table 1: the number of links",
        paragraph(
            "Models of several sizes, each identified on the three fitted flights and judged on the three "
            "held out; what one flight of two seconds costs was measured for all in turn. "
            f"Recommended: {prettified(recommended['reason'])}"
        ),
        _study_table(found),
        _study_ratios(found),
        figure(
            "study",
            "Table 1 as a picture",
            "Above: J over the fitted flights and over those held out; below: one flight on one core. The "
            "band marks the recommended number of links.",
            study_figure(found),
        ),
    )


def _study_table(found: Document) -> str:
    rigid, recommended = found["rigid"], found["recommended"]["links_per_wing"]
    rows = [
        (
            "rigid",
            NOTHING,
            NOTHING,
            number(rigid["J_train"]),
            number(rigid["J_held_out"]),
            *[NOTHING] * 3,
            milliseconds(rigid["flight_s"]),
            NOTHING,
        )
    ]
    rows += [
        (
            str(row["links_per_wing"]),
            str(row["bodies"]),
            str(row["parameters"]),
            number(row["J_train"]),
            number(row["J_held_out"]),
            *(mrad(row["rms_rad"][angle]) for angle in ("phi", "theta", "psi")),
            milliseconds(row["flight_s"]),
            f"{row['identify_s']:.0f} s",
        )
        for row in found["rows"]
    ]
    strong = [i for i, row in enumerate(found["rows"], start=1) if row["links_per_wing"] == recommended]
    return table(
        "Table 1",
        "Accuracy and cost against the number of links a wing.",
        [
            words("links"),
            *(
                Column(name)
                for name in (
                    "bodies",
                    "unknowns",
                    "J fitted, rad²",
                    "J held out, rad²",
                    "φ, mrad",
                    "θ, mrad",
                    "ψ, mrad",
                    "flight, ms",
                    "found in",
                )
            ),
        ],
        rows,
        strong=strong,
        note="RMS of the angles on the flights held out. One link is the rigid model with its aerodynamic "
        "corrections identified. The symmetric flights do not roll or yaw.",
    )


def _study_ratios(found: Document) -> str:
    names = [fit["sample"] for fit in found["rows"][0]["fit"]]
    rows = [
        (str(row["links_per_wing"]), *(number(ratio(fit)) for fit in row["fit"])) for row in found["rows"]
    ]
    labels = _labels()
    return table(
        "",
        "J of the equivalent model over J of the rigid one, flight by flight.",
        [words("links"), *(Column(labels.get(name, name)) for name in names)],
        rows,
    )


def verification_section(results: Results) -> Section:
    """Figures 4 to 9 and the searches side by side."""
    found = results["identification"]
    ratios = [value for value in held_out_ratios(found).values() if value is not None]
    worst = number(max(ratios)) if ratios else NOTHING
    return section(
        "verification",
        "Figures 4 to 9: the equivalent model against the flexible one",
        paragraph(
            f"{LINKS} links a wing, identified on three flights. On the flights held out J is at most "
            f"{worst} of the rigid model's; {HELD_OUT_RATIO:g} was asked for."
        ),
        _fit_table(found),
        heading("Figures 4 to 6: the flights identified on"),
        *_flight_figures(found, "train", FIRST_FITTED),
        heading("Figures 7 to 9: the flights held out"),
        *_flight_figures(found, "held_out", FIRST_CHECK),
        heading("The identified model"),
        _model_table(found["model"]),
        heading("The search: ours and the paper's swarm"),
        *_searches(results),
    )


def _fit_table(found: Document) -> str:
    labels = _labels()
    rows = [
        (
            labels.get(fit["sample"], fit["sample"]),
            "fitted" if fit["role"] == "train" else "held out",
            number(fit["J_rigid"]),
            number(fit["J_initial"]),
            number(fit["J_identified"]),
            number(ratio(fit)),
            mrad(fit["rms_rigid_rad"]["theta"]),
            mrad(fit["rms_rad"]["theta"]),
            mrad(fit["max_abs_rad"]["theta"]),
        )
        for fit in found["fit"]
    ]
    return table(
        "",
        "J (rad²) of the rigid model, of the physical guess and of the identified model; RMS and largest "
        "error of pitch, mrad.",
        [
            words("flight"),
            words("role"),
            *(
                Column(name)
                for name in ("J rigid", "J guess", "J identified", "ratio", "rigid θ", "θ", "largest θ")
            ),
        ],
        rows,
    )


def _flight_figures(found: Document, role: str, first: int) -> list[str]:
    labels = _labels()
    chosen = [curves for curves in found["curves"] if curves["role"] == role]
    return [
        figure(
            f"figure-{number_}",
            f"Figure {number_}",
            f"Flight {labels.get(curves['name'], curves['name'])}: pitch of the three models; error of the "
            "equivalent model on an axis of its own; sweep.",
            verification_figure(curves),
        )
        for number_, curves in enumerate(chosen, start=first)
    ]


def _model_table(model: Document) -> str:
    aero, division = model["aero"], model["division"]
    rows = [
        (str(joint), *(f"{value:,.0f}" for value in stiffness), *(number(v) for v in _each(damping)))
        for joint, (stiffness, damping) in enumerate(
            zip(model["stiffness_nm_rad"], model["damping_nms_rad"], strict=True), start=1
        )
    ]
    corrections = (
        f"Lengths of the links, root to tip, of the span: {', '.join(number(value) for value in division)}. "
        f"Corrections: lift factor {number(aero['lift_factor'])}, aerodynamic centre moved by "
        f"{number(1e3 * aero['centre_shift_m'])} mm, profile drag {number(aero['profile_drag'])}, lag "
        f"{number(1e3 * aero['lag_s'])} ms."
    )
    axes = ("flap", "torsion", "lag")
    return table(
        "",
        "Joints of the identified model: stiffness k, N m/rad, and damping c, N m s/rad.",
        [words("joint"), *(Column(f"k {axis}") for axis in axes), *(Column(f"c {axis}") for axis in axes)],
        rows,
        note=corrections,
    )


def _searches(results: Results) -> list[str]:
    searches = {"ours": results["identification"]["search"], "the paper's swarm": results["swarm"]["search"]}
    particles = results["swarm"]["search"]["history"][-1]["particles"]
    rows = [
        (
            name,
            f"{each['flights']:,}",
            str(each["generations"]),
            number(each["best_cost"]),
            minutes(each["wall_s"]),
        )
        for name, each in searches.items()
    ]
    return [
        table(
            "",
            "Two searches for the same unknowns on the same flights.",
            [
                words("search"),
                *(Column(name) for name in ("flights", "generations", "least J, rad²", "wall time")),
            ],
            rows,
            note=f"The swarm: {particles} particles, c1 = c2 = 1, inertia 0.7. Ours: candidates around beam "
            "theory, the best of them polished by least squares.",
        ),
        figure(
            "searches",
            "",
            "Least J so far against the flights flown.",
            search_figure({name: each["history"] for name, each in searches.items()}),
        ),
    ]


def computation_section(results: Results) -> Section:
    """Table 2: what a flight costs."""
    found = results["computation"]
    first, batch = found["flights"][0], found["batch"]
    alone, whole = (percent(flight_share(first, "equivalent", part)) for part in ("fly_s", "total_s"))
    in_batch, flexible_s = batch_share(found), first["models"]["flexible"]["total_s"]
    return section(
        "computation",
        "Table 2: computation",
        paragraph(
            f"The flight of two seconds takes the equivalent model {alone} of the flexible model's "
            f"computation, {whole} with the lattice along the morph and the trim; among "
            f"{batch['parameter_sets']:,} that fly together {percent(in_batch)}. The paper: about "
            f"{PAPER_COMPUTATION:g} per cent. Asked for: {FLIGHT_PERCENT:g} per cent alone, "
            f"{BATCH_PERCENT:g} in a batch. Mind what the ratio stands against: our flexible model was made "
            f"for this task and flies the two seconds in {number(flexible_s, 2)} s, so that the same "
            "equivalent model would show a smaller ratio beside a slower one."
        ),
        _computation_table(found),
        _batch_table(found),
        *_beside_another_program(results),
    )


def _computation_table(found: Document) -> str:
    rows = []
    for flown in found["flights"]:
        models = flown["models"]
        for model in ("flexible", "equivalent", "rigid"):
            times = models[model]
            rows.append(
                (
                    flown["label"] if model == "flexible" else "",
                    model,
                    milliseconds(times["prepare_s"]),
                    milliseconds(times["fly_s"]),
                    milliseconds(times["total_s"]),
                    percent(flight_share(flown, model)) if model != "flexible" else "100 %",
                    percent(flight_share(flown, model, "total_s")) if model != "flexible" else "100 %",
                    number(flown["duration_s"] / times["total_s"]),
                    f"{flown['slowest_over_fastest'][model]:.2f}",
                )
            )
    headings = (
        "prepare, ms",
        "fly, ms",
        "both, ms",
        "fly, of flexible",
        "both, of flexible",
        "× real",
        "spread",
    )
    return table(
        "Table 2",
        "Computation of one flight on one core, one at a time.",
        [words("flight"), words("model"), *(Column(name) for name in headings)],
        rows,
        note="Processor time, medians of interleaved repetitions; “prepare” is the lattice along the morph "
        "(flexible model: the first one) and the trim; “× real” is simulated over computed time; “spread” is "
        "the slowest repetition over the fastest.",
    )


def _batch_table(found: Document) -> str:
    batch = found["batch"]
    count = batch["parameter_sets"]
    rows = [
        (
            f"{count:,}",
            milliseconds(batch["prepare_s"]),
            milliseconds(batch["fly_s"]),
            milliseconds(batch["flight_s"]),
            percent(batch_share(found)),
        )
    ]
    return table(
        "",
        "Equivalent models with different parameters that fly the two seconds together, on one core.",
        [
            Column(name)
            for name in (
                "models",
                "lattice and trims, ms",
                "fly, ms",
                "each flight, ms",
                "of one flexible flight",
            )
        ],
        rows,
    )


def _beside_another_program(results: Results) -> list[str]:
    """What another program noted for a flight that was timed here too."""
    noted = results["independent"].get("theirs", {}).get("wall_s", {}).get(f"train_{COMMON_FLIGHT}")
    own = [row for row in results["computation"]["flights"] if row["flight"] == COMMON_FLIGHT]
    if not noted or not own:
        return []
    models = own[0]["models"]
    equivalent, flexible = models["equivalent"]["total_s"], models["flexible"]["total_s"]
    return [
        paragraph(
            "Beside another flexible program the ratio is another: the independent one noted "
            f"{number(noted)} s for the flight at 0.5 rad/s, on a machine of its own. Our equivalent model, "
            f"lattice and trim included, takes {percent(equivalent / noted)} of that here, our flexible "
            f"model {percent(flexible / noted)}."
        )
    ]


def _labels() -> dict[str, str]:
    return {each.name: each.label for each in paper_flights()}


def _each(value: float | Sequence[float]) -> Sequence[float]:
    """Damping of each axis: one number may stand for all three."""
    return value if isinstance(value, Sequence) else [value] * 3
