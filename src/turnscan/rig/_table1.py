"""Table 1 of the paper, computed, and where the paper's own equations do not give it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from turnscan.rig import _paper as paper
from turnscan.rig._design import Design
from turnscan.rig._presets import design_preset

TABLE_1_ANGLES_DEG = (10.0, 15.0, 30.0, 45.0, 60.0)
TABLE_1_DECIMALS = {
    "delta_x": (2, 2, 2, 2, 2),
    "delta_r": (2, 2, 2, 2, 2),
    "r_max": (0, 0, 0, 0, 0),
    "h_max": (0, 0, 0, 0, 0),
    "ratio": (3, 4, 4, 4, 4),
}
"""Decimal places to which the paper rounds each number of a row (trailing zeros dropped)."""


@dataclass(frozen=True)
class TableRow:
    """One angle of Table 1, unrounded."""

    theta: float
    """radians."""
    delta_x: float
    """Depth resolution by (7), mm."""
    delta_r: float
    """ε L/(f sin θ), mm."""
    r_max: float
    """mm."""
    h_max: float
    """Height that the rows see at R_max, mm."""

    @property
    def ratio(self) -> float:
        """ΔR/R_max."""
        return self.delta_r / self.r_max


@dataclass(frozen=True)
class Disagreement:
    """A place where what the paper prints and what its equation gives differ."""

    where: str
    printed: tuple[str, ...]
    """As the table or the text prints it."""
    equation: tuple[float, ...]
    """What the printed equation gives, unrounded, in the same order."""
    message: str
    """One line: which is which, and what reproduces the print."""


def table_1_designs() -> tuple[Design, ...]:
    """The paper's rig at the five angles of Table 1."""
    base = design_preset("paper")
    return tuple(replace(base, theta=math.radians(t)) for t in TABLE_1_ANGLES_DEG)


def table_1() -> tuple[TableRow, ...]:
    """Table 1 from the formulas that reproduce its print; for the equations see `disagreements`."""
    return tuple(_row(d) for d in table_1_designs())


def _row(d: Design) -> TableRow:
    r_max = float(paper.r_max(d.gamma_max, d.theta, d.distance))
    args = (d.pixel_width, d.theta, d.distance, d.focal)
    return TableRow(
        theta=d.theta,
        delta_x=float(paper.delta_x_small_pixel(*args)),
        delta_r=float(paper.delta_r_tabulated(*args)),
        r_max=r_max,
        h_max=float(paper.h_max_tabulated(r_max, d.beta_max, d.theta, d.distance)),
    )


def as_printed(value: float, decimals: int) -> str:
    """Round as the paper does: fixed places, then no trailing zeros (2.50 → 2.5)."""
    text = f"{value:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def table_1_text(name: str) -> tuple[str, ...]:
    """One row of Table 1 as printed, ``name`` being a field of `TableRow`.

    The row ``ratio`` divides the two printed rows, as the paper evidently did.
    """
    values: Iterable[float] = (getattr(r, name) for r in table_1())
    if name == "ratio":
        printed = zip(table_1_text("delta_r"), table_1_text("r_max"), strict=True)
        values = (float(r) / float(r_max) for r, r_max in printed)
    return tuple(as_printed(v, p) for v, p in zip(values, TABLE_1_DECIMALS[name], strict=True))


def disagreements() -> tuple[Disagreement, ...]:
    """Every place of the paper where the printed equation and the printed number differ."""
    designs, rows = table_1_designs(), table_1()

    def each(f: Callable[[Design], float]) -> tuple[float, ...]:
        return tuple(f(d) for d in designs)

    eq6, eq5 = each(lambda d: d.delta_x_eq6), each(lambda d: d.delta_r_eq5)
    printed_h = each(lambda d: d.h_max_printed)
    rim = each(lambda d: d.delta_r_rim)
    ratio = tuple(r.ratio for r in rows)
    quotes = [_quoted_resolution(rows[i], int(rows[i].theta * 180 / math.pi + 0.5)) for i in (0, 4)]
    sharp = " and ".join(
        f"{rim[i]:.3f} mm or 1/{rows[i].r_max / rim[i]:.0f} at {TABLE_1_ANGLES_DEG[i]:.0f}°"
        for i in (0, 4)
    )
    return (
        Disagreement(
            "Table 1, Δx",
            table_1_text("delta_x"),
            eq6,
            f"Δx row: the table uses the approximation (7), εL/(f tan θ); equation (6) gives "
            f"{_listed(eq6, 2)}, which differs at {_differing('delta_x', eq6)}",
        ),
        Disagreement(
            "Table 1, ΔR",
            table_1_text("delta_r"),
            eq5,
            f"ΔR row: the table is εL/(f sin θ), that is (7) divided by cos θ; equation (5) as "
            f"printed gives {_listed(eq5, 2)}, which differs at {_differing('delta_r', eq5)}",
        ),
        Disagreement(
            "Table 1, H_max",
            table_1_text("h_max"),
            printed_h,
            f"H_max row: the table is 2(L − R_max cos θ) tan(β_max/2); the printed formula takes "
            f"tan of β_max = 2·atan(…), the full angle, and gives {_listed(printed_h, 0)}, which "
            f"differs at {_differing('h_max', printed_h)}",
        ),
        Disagreement(
            "Table 1, ΔR/R_max",
            table_1_text("ratio"),
            ratio,
            f"ΔR/R_max row: the table divides its own rounded rows, and prints 10° to three "
            f"places only; unrounded the row is {_listed(ratio, 5)}, which to the printed places "
            f"differs at {_differing('ratio', ratio)}",
        ),
        *quotes,
        Disagreement(
            "text, theoretical resolution",
            tuple(q.printed[0] for q in quotes),
            (rows[0].r_max / rim[0], rows[4].r_max / rim[4]),
            f"rim resolution: the paper divides a pixel at the axis by the radius of the rim; at "
            f"R_max itself a pixel is worth {sharp}",
        ),
    )


def _quoted_resolution(row: TableRow, theta_deg: int) -> Disagreement:
    places = TABLE_1_DECIMALS["ratio"][TABLE_1_ANGLES_DEG.index(theta_deg)]
    rounded = as_printed(row.ratio, places)
    quote = f"1/{1 / float(rounded):.0f}"
    return Disagreement(
        f"text, resolution at {theta_deg}°",
        (quote,),
        (1 / row.ratio,),
        f"resolution at {theta_deg}°: the text's {quote} is one over the rounded {rounded}; "
        f"unrounded it is 1/{1 / row.ratio:.0f}",
    )


def _listed(values: Iterable[float], decimals: int) -> str:
    return " ".join(as_printed(v, decimals) for v in values)


def _differing(name: str, values: Sequence[float]) -> str:
    """The angles at which ``values`` do not round to what Table 1 prints."""
    places, print_ = TABLE_1_DECIMALS[name], table_1_text(name)
    angles = [
        f"{t:g}°"
        for t, v, p, text in zip(TABLE_1_ANGLES_DEG, values, places, print_, strict=True)
        if as_printed(v, p) != text
    ]
    return ", ".join(angles) or "no angle"
