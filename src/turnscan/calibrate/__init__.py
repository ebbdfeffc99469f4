"""Views of a target or an artefact → Rig + covariance + findings."""

from turnscan.calibrate._angle import TableAngle, measure_table_angle
from turnscan.calibrate._steps import AngleModel, angle_model

__all__ = ["AngleModel", "TableAngle", "angle_model", "measure_table_angle"]
