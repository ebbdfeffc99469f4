"""Bodies of POSTs, and of their answers."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from turnscan.app._protocol import Model, Opaque


class LoginRequest(Model):
    """POST ``/login``: the token from the link, for a cookie."""

    token: Annotated[str, Field(max_length=200)]


class Invitation(Model):
    """POST ``/api/invitations``: a link for one more browser, good once."""

    path: str


class ExportRequest(Model):
    """POST ``/api/scans/{scan}/exports``."""

    format: Literal["dxf", "stl", "ply", "obj", "3mf", "glb", "xyz", "step"]
    dxf_forms: tuple[Literal["3dface", "polyface", "mesh", "profiles"], ...] = ("3dface",)
    dxf_version: Literal["R12", "R2010"] | None = None
    ascii: bool = False
    obj_texture: bool = False
    """Also the colours of an OBJ as a texture: then the download is a zip of three files."""


class StartedExport(Model):
    """Its answer."""

    job: Opaque


class Added(Model):
    """The answer to POST ``/api/scans``."""

    scan: Opaque


class Received(Model):
    """The answer to POST ``/api/files``."""

    into: Opaque
    """The set of files, for the next one that belongs to it."""
    files: list[Opaque]
    """What is in the set now."""


class Uploaded(Model):
    """The answer to POST and GET ``/api/uploads``: how much of a file is here."""

    upload: Opaque
    received: int
    """Bytes; the next piece begins there."""


class Problem(Model):
    """The body of every HTTP error."""

    code: str
    text: str
    hint: str
