"""The table of docs/safety.md: after each fault it is dark in the time that is stated."""

from __future__ import annotations

import pytest

from tests.safety.conftest import Metronome
from tests.safety.faults import CASES, Case


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_dark_in_time(case: Case, metronome: Metronome) -> None:
    """Judged strictly, each time, by the time in which the machine had a processor to spare."""
    spans = case.spans()
    print(f"{case.fault}: {max(s.seconds for s in spans) * 1e3:.0f} ms")
    for dialect, span in zip(case.dialects, spans, strict=True):
        assert metronome.served(span.begin, span.dark) < case.limit, dialect
