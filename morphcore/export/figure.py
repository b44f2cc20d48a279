"""Parts shared by all figures: panels over time, flat axes, titles and numbers, files without dates."""

from __future__ import annotations

import io
import threading
import unicodedata
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from morphcore.export.curves import SWEEPS
from morphcore.stopping import check_stop
from morphdata.drives import without_side

Array = NDArray[np.float64]
Document = dict[str, Any]

ANGLES = (("phi_rad", "roll φ"), ("theta_rad", "pitch θ"), ("psi_rad", "yaw ψ"))
# Okabe & Ito's palette, distinguishable for colour-blind readers; line styles differ too, for print
BLUE, VERMILION, GREEN, ORANGE, SKY = "#0072B2", "#D55E00", "#009E73", "#E69F00", "#56B4E9"
INK, GRID = "0.15", "0.88"

SILENT_RAD = 1e-6  # an angle that stays below this is round-off, not motion
SILENT_SPAN_DEG = 0.1  # half the height of the axis on which it is drawn, as a flat line
LEGEND_HEAD_IN, TITLE_HEAD_IN = 0.62, 0.36  # inches above the panels: for title and legend, for a title only
PNG_DPI = 110
LONGEST_TITLE = 70  # characters
MAX_POINTS = 4000  # points of a curve: more than the pixels of a page
HASH_SALT = "morphid"  # the only input of element ids in SVG
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

_drawing = threading.Lock()


# panels


def stack(figure: Figure, heights: Sequence[float], head_in: float = LEGEND_HEAD_IN) -> list[Axes]:
    """Stack panels of the given relative heights with a common abscissa.

    ``head_in`` : free space above them, inches.
    """
    inches = float(figure.get_figheight())
    grid = figure.add_gridspec(
        len(heights),
        1,
        height_ratios=list(heights),
        hspace=0.14,
        left=0.115,
        right=0.98,
        top=1.0 - head_in / inches,
        bottom=0.5 / inches,
    )
    rows: list[Axes] = []
    for i in range(len(heights)):
        rows.append(figure.add_subplot(grid[i, 0], sharex=rows[0] if rows else None))
    return rows


def label_axis(axes: Axes, text: str) -> None:
    """Label an ordinate (quantity, unit), with plain numbers, a light grid and no box."""
    axes.set_ylabel(text, fontsize=9)
    axes.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]))
    axes.ticklabel_format(axis="y", style="plain", useOffset=False)
    axes.tick_params(labelsize=8.5)
    axes.margins(x=0.0)
    light_grid(axes)


def light_grid(axes: Axes) -> None:
    """Draw a light grid behind the lines, and no frame on the right and at the top."""
    axes.grid(visible=True, which="major", linewidth=0.4, color=GRID)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def time_axis(figure: Figure, rows: Sequence[Axes], time_s: Array) -> None:
    """Set the abscissa of a stack of panels, labelled below the last."""
    for axes in rows[:-1]:
        axes.tick_params(labelbottom=False)
    rows[-1].set_xlabel("time, s", fontsize=9)
    rows[0].set_xlim(time_s[0], time_s[-1])
    figure.align_ylabels(rows)


def draw(axes: Axes, time_s: Array, values: Array, **style: Any) -> None:
    """Draw a curve with no more points than a page can show."""
    every = -(-time_s.size // MAX_POINTS)
    axes.plot(time_s[::every], values[::every], **style)


def drive_panels(columns: Document, drives: Sequence[str] = SWEEPS) -> list[tuple[str, Array, Array]]:
    """Contents of the drives' panels: for each word its label, and left and right in its unit, deg or m.

    Columns are named ``<drive>_rad`` or ``<drive>_m``. For a drive on one side only, both values are its own,
    and the label names the side.
    """
    pairs: dict[str, dict[str, Array]] = {}
    units: dict[str, str] = {}
    for name in drives:
        word = without_side(name)
        side = name.removeprefix(word).removeprefix("_")
        if f"{name}_rad" in columns:
            pairs.setdefault(word, {})[side] = np.degrees(series(columns[f"{name}_rad"]))
        elif f"{name}_m" in columns:
            pairs.setdefault(word, {})[side] = series(columns[f"{name}_m"])
            units[word] = "m"
    panels = []
    for word, of_sides in pairs.items():
        angles = list(of_sides.values())
        alone = f" {next(iter(of_sides))}".rstrip() if len(of_sides) == 1 else ""
        label = f"{printable(word)}{alone}".replace("_", " ") + f", {units.get(word, 'deg')}"
        panels.append((label, of_sides.get("left", angles[0]), of_sides.get("right", angles[-1])))
    return panels


def draw_drive(axes: Axes, time_s: Array, panel: tuple[str, Array, Array]) -> None:
    """Draw a drive's panel, both sides; one line if they are equal."""
    label, left, right = panel
    draw_sides(axes, time_s, left, right, np.degrees(SILENT_RAD))
    label_axis(axes, label)


def draw_sides(axes: Axes, time_s: Array, left: Array, right: Array, alike: float) -> None:
    """Draw a quantity of both wings: two lines with a legend, or one if they differ by at most ``alike``."""
    draw(axes, time_s, right, color=INK, linewidth=1.2, label="right")
    if not np.nanmax(np.abs(left - right)) <= alike:
        draw(axes, time_s, left, color=INK, linewidth=1.2, linestyle=(0, (4, 2)), label="left")
        axes.legend(frameon=False, fontsize=8, loc="best", handlelength=2.2)


def quiet(axes: Axes, span: float) -> None:
    """Scale the axis of an angle that does not move, so that round-off is a flat line."""
    axes.set_ylim(-span, span)
    axes.set_yticks([-span, 0.0, span])


def headline(figure: Figure, text: str) -> None:
    """Set the figure's title, never interpreted as a formula."""
    inches = float(figure.get_figheight())
    figure.text(0.5, 1.0 - 0.1 / inches, text, ha="center", va="top", fontsize=10, parse_math=False)


def legend_above(
    figure: Figure, handles: Sequence[Line2D], *, columns: int = 4, below_top_in: float = 0.27
) -> None:
    """Add one legend for all panels, below the title or, without one, at the very top."""
    inches = float(figure.get_figheight())
    figure.legend(
        handles=list(handles),
        loc="upper center",
        bbox_to_anchor=(0.5, 1.0 - below_top_in / inches),
        ncols=columns,
        frameon=False,
        fontsize=8.5,
        handlelength=2.6,
        columnspacing=1.4,
    )


# numbers and names


def series(values: Sequence[float | None]) -> Array:
    """Numbers as an array, with None as NaN, which interrupts lines."""
    return np.array(values, dtype=np.float64)


def is_silent(curves: Sequence[Array]) -> bool:
    """Whether angles (rad) stay within round-off."""
    return all(np.all(np.isnan(values) | (np.abs(values) < SILENT_RAD)) for values in curves)


def is_cost(value: object) -> bool:
    """Whether a value can be shown on a logarithmic axis."""
    return isinstance(value, int | float) and bool(np.isfinite(value)) and value > 0.0


def power_of_ten(value: float, _position: object = None) -> str:
    """A tick of a logarithmic axis: 10⁻³, or 2·10⁻³ between the decades."""
    exponent = int(np.floor(np.log10(value) + 1e-9))
    lead = value / 10.0**exponent
    power = "10" + str(exponent).translate(SUPERSCRIPTS)
    return power if abs(lead - 1.0) < 1e-6 else f"{lead:.0f}·{power}"


def scientific(value: float) -> str:
    """Three digits and a power of ten."""
    lead, exponent = f"{value:.2e}".split("e")
    return f"{lead}·10{str(int(exponent)).translate(SUPERSCRIPTS)}"


def printable(text: str) -> str:
    """A name in displayable form: on one line, no control characters, not too long."""
    known = get_font(findfont(FontProperties(family="DejaVu Sans"))).get_charmap()
    shown = "".join(
        (c if ord(c) in known else "?") if unicodedata.category(c)[0] != "C" else " "
        for c in text[: 2 * LONGEST_TITLE]
    )
    return shown if len(shown) <= LONGEST_TITLE else f"{shown[: LONGEST_TITLE - 1]}…"


# rendering


def rendered(
    stem: str, figure: Figure, kinds: Sequence[Literal["svg", "png"]] = ("svg", "png")
) -> dict[str, bytes]:
    """File name -> content for each format; the same figure gives the same bytes.

    Raises
    ------
    Interrupted : the surrounding `stoppable` block was stopped; a figure takes over a second to draw.
    """
    check_stop()
    files: dict[str, bytes] = {}
    with _drawing:
        if "svg" in kinds:
            vector = io.BytesIO()
            with _fixed_ids():
                figure.set_canvas(FigureCanvasSVG(figure))
                figure.savefig(vector, format="svg", metadata={"Date": None, "Creator": "MorphID"})
            files[f"{stem}.svg"] = vector.getvalue()
        if "png" in kinds:
            pixels = io.BytesIO()
            figure.set_canvas(FigureCanvasAgg(figure))
            figure.savefig(pixels, format="png", dpi=PNG_DPI, metadata={"Software": "MorphID"})
            files[f"{stem}.png"] = pixels.getvalue()
    return files


@contextmanager
def _fixed_ids() -> Iterator[None]:
    """Make element ids depend on the figure only; matplotlib reads the salt from its global settings."""
    former = mpl.rcParams["svg.hashsalt"]
    mpl.rcParams["svg.hashsalt"] = HASH_SALT
    try:
        yield
    finally:
        mpl.rcParams["svg.hashsalt"] = former
