"""What a calibration starts from: pictures, what the user knows, and what was not used."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.arrays import Floats
from turnscan.calibrate._board import Board, BoardView
from turnscan.calibrate._light import StripeLight
from turnscan.calibrate._margin import USUAL
from turnscan.calibrate._markers import MarkerView
from turnscan.stripes import Orientation


@dataclass(frozen=True)
class LaserPicture:
    """A board with a stripe on it."""

    view: BoardView
    candidates: Floats
    """(n, 2) px, from `stripe_light`."""
    margin: Floats | None = None
    """(4,) mm of flat board beyond the pattern's left, top, right and bottom, from `white_margin`;
    None where the picture was not asked."""
    widths: Floats | None = None
    """(n,) px rms of the light at the candidates; None where they were not kept."""
    on_print: Floats | None = None
    """(n, 2) px: the candidates as light that fell on the board's print, from `stripe_light`; None
    where there is no picture without the laser."""
    widths_on_print: Floats | None = None
    """(n,) px rms of that light."""

    @classmethod
    def of(cls, view: BoardView, light: StripeLight, margin: Floats | None = None) -> LaserPicture:
        """With what `stripe_light` found."""
        return cls(view, light.places, margin, light.widths, light.on_print, light.widths_on_print)

    @property
    def printed(self) -> LaserPicture:
        """The same with the light as it fell on the print; itself where that is not known."""
        if self.on_print is None:
            return self
        return LaserPicture(self.view, self.on_print, self.margin, self.widths_on_print)

    def around(self, settings: CalibrationSettings) -> float | Floats:
        """mm of board around the pattern: as the user says, else as the picture shows."""
        if settings.margin is not None:
            return settings.margin
        return USUAL * self.view.board.square if self.margin is None else self.margin


@dataclass(frozen=True)
class TablePicture:
    """What is fixed to the table in one picture, and the stripes there."""

    seen: MarkerView | BoardView
    candidates: dict[str, Floats]
    """Per laser lit in this picture: (n, 2) px."""
    name: str
    step: float
    """How many steps the table had been sent."""


@dataclass(frozen=True)
class CalibrationSettings:
    """What the user knows about the rig."""

    dictionary: str = "DICT_4X4_50"
    """Of the markers on the platter."""
    marker_side: float = 0.0
    """mm, nominal; compared, and trusted only where nothing else gives the scale."""
    step: float | None = None
    """rad per step number, nominal; compared."""
    margin: float | None = None
    """mm of flat board around the printed pattern; None is what the pictures show."""
    orientation: Orientation = "vertical"
    """Of the stripes in the picture."""
    table_board: Board | None = None
    """The board fixed to the table, instead of markers."""
    lowest: float = 0.0
    """mm: height of that board's lowest corner above the platter."""


@dataclass(frozen=True)
class Rejected:
    """A picture that was not used, and why."""

    role: str
    name: str
    reason: str
