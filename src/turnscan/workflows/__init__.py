"""Each verb as a function: typed options in, result and findings out; the doors only translate."""

from turnscan.workflows._artefact import PAPERS, TARGET, artefact
from turnscan.workflows._verify import (
    Trend,
    Verification,
    Verified,
    read_artefact,
    verification_json,
    verify,
)

__all__ = [
    "PAPERS",
    "TARGET",
    "Trend",
    "Verification",
    "Verified",
    "artefact",
    "read_artefact",
    "verification_json",
    "verify",
]
