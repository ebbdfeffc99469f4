"""What messages and requests are made of."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

VERSION = 1
"""Of the protocol; the page reloads itself where it has another one."""
Name = Annotated[str, Field(min_length=1, max_length=200)]
Opaque = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{4,64}$")]
"""A name that the server gave, and that means nothing outside of it."""
Count = Annotated[int, Field(ge=0, lt=2**53)]
Vector = tuple[float, float, float]
Box = tuple[Vector, Vector]


class Model(BaseModel):
    """Strict: nothing unknown, no NaN, and never changed."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


class Remark(Model):
    """A finding, in words."""

    code: str
    severity: Literal["note", "warning", "error"]
    text: str
    where: str
    remedy: str
    options: list[RemedyOption] = Field(default_factory=list)
    """Those that the remedy names."""


class RemedyOption(Model):
    """An option that a remedy or an error names, by the name in the verb's schema."""

    name: str
    value: str | None
    """As it is written in a field; None where no value is meant."""
