"""The section on the set-up: aircraft, flights, models and searches."""

from __future__ import annotations

import numpy as np

from morphcore.paper.report.html import Column, Section, number, paragraph, section, table, words
from morphcore.paper.scenario import (
    FLIGHT,
    LINKS,
    MORPH_S,
    RATE_LIMIT_RAD_S,
    SETTLE_S,
    aircraft,
    paper_flights,
)
from morphcore.paper.settings import PaperSettings
from morphcore.paper.stages import Results
from morphcore.simulate.plan import STEP_S

ROLES = {"train": "identified on", "held_out": "held out, to check"}


def scenario_section(settings: PaperSettings, results: Results) -> Section:
    """Aircraft, flights, models."""
    return section(
        "setup",
        "Set-up",
        paragraph(
            "Sizes, sweep rates and the roles of the flights are the paper's. Its text prints neither "
            "density nor modulus nor speed; these are ours. The truth that all is measured against is our "
            "own flexible model."
        ),
        _aircraft_table(),
        _flights_table(),
        _models_table(settings, results),
    )


def _aircraft_table() -> str:
    craft = aircraft()
    wing = craft.surfaces[0]
    properties = wing.section_at(np.array([0.5 * wing.span_m]))
    fuselage, material = craft.fuselage, wing.material
    wing_mass = float(properties.mass[0]) * wing.span_m
    rows = [
        ("fuselage, a box", "5.0 × 0.7 × 0.5 m", "paper"),
        ("each wing, a box", "3.0 × 0.3 × 0.1 m", "paper"),
        ("wings hinged at the fuselage's sides, sweep", "0 to 1 rad", "paper"),
        ("density of all", f"{number(material.density_kg_m3)} kg/m³", "ours"),
        (
            "Young's modulus; Poisson's ratio",
            f"{number(material.youngs_modulus_pa / 1e9, 2)} GPa; {material.poisson_ratio:g}",
            "ours",
        ),
        ("structural damping, of stiffness", f"{material.stiffness_damping_s:g} s", "ours"),
        (
            "bending stiffness EI, flap; lag",
            f"{float(properties.ei_flap[0]):,.0f}; {float(properties.ei_lag[0]):,.0f} N m²",
            "follows",
        ),
        ("torsional stiffness GJ", f"{float(properties.gj[0]):,.0f} N m²", "follows"),
        (
            "mass of the fuselage; of a wing",
            f"{fuselage.mass_kg:,.0f}; {wing_mass:,.0f} kg",
            "follows",
        ),
        (
            "airspeed; air density; gravity",
            "{airspeed_m_s:g} m/s; {air_density_kg_m3:g} kg/m³; {gravity_m_s2:g} m/s²".format(**FLIGHT),
            "ours",
        ),
        ("profile drag coefficient of the wings", f"{wing.profile_drag:g}", "ours"),
    ]
    return table("", "Aircraft and flight condition.", [words("what"), words("value"), words("whose")], rows)


def _flights_table() -> str:
    rows = []
    for each in paper_flights():
        schedule = each.schedule
        kind = "constant rate" if schedule["kind"] == "constant_rate" else "quadratic in time"
        rows.append(
            (each.label, kind, number(schedule["duration_s"]), number(each.duration_s), ROLES[each.role])
        )
    return table(
        "",
        "The six flights: both wings from 0 to 1 rad, free flight, thrust and trim moment held.",
        [words("flight"), words("sweep"), Column("morph, s"), Column("flight, s"), words("used")],
        rows,
        note="Each holds its shape for 0.2 s before and 0.3 s after; constant rates are ramped over 0.1 s.",
    )


def _models_table(settings: PaperSettings, results: Results) -> str:
    lattice, elements = settings.lattice, settings.elements
    panels = f"{lattice.chordwise} × {lattice.spanwise} panels a wing, vortex core “{lattice.core.law}”"
    step_s = results["truth"]["resolution"]["step_s"]
    flexible = (
        f"{elements} geometrically exact beam elements a wing on SE(3); generalised-alpha, "
        f"{1e3 * step_s:g} ms; a fresh lattice on the bent wings in every step"
    )
    equivalent = (
        f"{LINKS} rigid links a wing, joined by gimbals with springs and dampers; second-order linearly "
        f"implicit, {1e3 * STEP_S:g} ms; the lattice tabulated along the morph; corrections for lift, "
        "centre, drag and lag"
    )
    morph = (
        f"1 rad in {MORPH_S:g} s, rate at most {RATE_LIMIT_RAD_S:g} rad/s, attitude counted for "
        f"{SETTLE_S:g} s after it"
    )
    rows = [
        ("flexible", flexible),
        ("equivalent", equivalent),
        ("rigid", "every wing one link; otherwise as the equivalent model, nothing fitted"),
        ("lattice of all three", panels),
        ("optimised morph", morph),
    ]
    return table("", "Models.", [words("model"), words("made of")], rows)
