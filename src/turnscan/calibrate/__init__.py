"""Views of a target or an artefact → Rig + covariance + findings."""

from turnscan.calibrate._advice import Advice, advice_of
from turnscan.calibrate._angle import moved_platter, platter_seen
from turnscan.calibrate._board import (
    Board,
    BoardView,
    Charuco,
    Chessboard,
    detect_board,
    other_chessboard,
    parse_board,
)
from turnscan.calibrate._bodies import Balls, Round
from turnscan.calibrate._evidence import CalibrationSettings, LaserPicture, TablePicture
from turnscan.calibrate._findings import findings_of
from turnscan.calibrate._light import laser_weights, stripe_light
from turnscan.calibrate._limits import refuse_poor
from turnscan.calibrate._margin import white_margin
from turnscan.calibrate._markers import MarkerView, aruco_dictionary, detect_markers
from turnscan.calibrate._pairs import fit_sheet
from turnscan.calibrate._parameters import parameters_of
from turnscan.calibrate._part import Part
from turnscan.calibrate._picture import picture_fault
from turnscan.calibrate._procedure import KnownRig
from turnscan.calibrate._quality import (
    CalibrationQuality,
    Measured,
    coverage,
    figures,
    measured_uncertainty,
)
from turnscan.calibrate._refine import Refined, RefineSettings, refine
from turnscan.calibrate._rig import Calibration, calibrate_rig
from turnscan.calibrate._steps import angle_model
from turnscan.calibrate._sweeps import Sweep
from turnscan.calibrate._turning import Outline, contradicted_step, outlines_of

__all__ = [
    "Advice",
    "Balls",
    "Board",
    "BoardView",
    "Calibration",
    "CalibrationQuality",
    "CalibrationSettings",
    "Charuco",
    "Chessboard",
    "KnownRig",
    "LaserPicture",
    "MarkerView",
    "Measured",
    "Outline",
    "Part",
    "RefineSettings",
    "Refined",
    "Round",
    "Sweep",
    "TablePicture",
    "advice_of",
    "angle_model",
    "aruco_dictionary",
    "calibrate_rig",
    "contradicted_step",
    "coverage",
    "detect_board",
    "detect_markers",
    "figures",
    "findings_of",
    "fit_sheet",
    "laser_weights",
    "measured_uncertainty",
    "moved_platter",
    "other_chessboard",
    "outlines_of",
    "parameters_of",
    "parse_board",
    "picture_fault",
    "platter_seen",
    "refine",
    "refuse_poor",
    "stripe_light",
    "white_margin",
]
