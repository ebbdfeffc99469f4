"""What requests are made of."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from turnscan.app._protocol import Count, Model

Stage = Literal["camera", "laser", "table"]
Seconds = Annotated[float, Field(gt=0, le=60)]
Angle = Annotated[float, Field(ge=-36000, le=36000)]
"""Degrees."""
Ruler = Annotated[float, Field(gt=0, le=1000)]
Limit = Annotated[float, Field(ge=-1e6, le=1e6)]


class Request(Model):
    """What all requests have."""

    id: Count
