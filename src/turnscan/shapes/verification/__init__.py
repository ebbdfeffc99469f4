"""A scan of a measured artefact → test values with uncertainty, repeatability and drift."""

from turnscan.shapes.verification._artefact import (
    Artefact,
    Kind,
    Length,
    Test,
    artefact_from_text,
    tests_of,
)
from turnscan.shapes.verification._balls import ball_at, find_balls
from turnscan.shapes.verification._bodies import (
    ball_bar_body,
    seat_height,
    stand_body,
    step_block_body,
)
from turnscan.shapes.verification._drift import Drift, drift
from turnscan.shapes.verification._faces import face_of, find_faces, joint, levels_of
from turnscan.shapes.verification._survey import Survey, survey_of_grids, survey_of_mesh
from turnscan.shapes.verification._values import (
    TestValue,
    ball_values,
    face_values,
    level_values,
    repeatability,
    values_of,
)

__all__ = [
    "Artefact",
    "Drift",
    "Kind",
    "Length",
    "Survey",
    "Test",
    "TestValue",
    "artefact_from_text",
    "ball_at",
    "ball_bar_body",
    "ball_values",
    "drift",
    "face_of",
    "face_values",
    "find_balls",
    "find_faces",
    "joint",
    "level_values",
    "levels_of",
    "repeatability",
    "seat_height",
    "stand_body",
    "step_block_body",
    "survey_of_grids",
    "survey_of_mesh",
    "tests_of",
    "values_of",
]
