"""The import form: what is recognised in the pictures that are chosen, before they are imported."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from typing import Any

from turnscan import workflows as w
from turnscan.app import _protocol as p
from turnscan.app import _requests as q
from turnscan.app._encode_picture import jpeg
from turnscan.app._envelope import Array
from turnscan.app._files import Files
from turnscan.app._jobs import remarks
from turnscan.app._verbs import by_laser, dark_of, input_files, options_from
from turnscan.errors import InputError

_INPUTS = {f.name: f for f in w.VERBS["import"].inputs}


class ImportRoom:
    """Looks at pictures. Its methods may be called from any thread; one looks at a time."""

    def __init__(self, files: Files, hide: Callable[[str], str]) -> None:
        self._files, self._hide = files, hide
        self._lock = threading.Lock()
        self._last: tuple[str, w.ImportPreview] | None = None
        """What was looked at last, so that another picture of it is shown at once."""

    def preview(self, request: q.PreviewImport) -> tuple[p.Model, dict[str, Array]]:
        """What an import would make of the pictures. Raises as `preview_import`."""
        with self._lock:
            looked = self._looked(request.values)
            series = next(
                (s for s in looked.series if s.series.laser == request.laser), looked.series[0]
            )
            number = len(series.names) // 2 if request.picture is None else request.picture
            shown = looked.picture(series.series.laser, number)
        data = jpeg(shown.picture)
        if data is None:
            raise InputError(f"{shown.name}: cannot be shown")
        answer = p.ImportPreviewed(
            id=request.id,
            series=[_seen(s) for s in looked.series],
            weights=None if looked.weights is None else list(looked.weights),
            findings=remarks(looked.findings, self._hide),
            laser=series.series.laser,
            picture=number,
            step=shown.step,
            width=shown.picture.shape[1],
            height=shown.picture.shape[0],
            orientation=looked.options.orientation,
        )
        return answer, {"jpeg": data, "stripe": shown.position}

    def _looked(self, given: dict[str, Any]) -> w.ImportPreview:
        values = dict(given)
        pictures = input_files(_INPUTS["pictures"], values.pop("pictures", None), self._files)
        dark = input_files(_INPUTS["dark"], values.pop("dark", None), self._files)
        laser = str(values.pop("laser", "") or "laser")
        options: w.ImportOptions = options_from(w.OptionsOf(w.ImportOptions), values)
        lasers = by_laser(pictures, laser)
        off = dark_of(lasers, [item.path for item in dark])
        key = json.dumps([{k: str(v) for k, v in some.items()} for some in (lasers, off)])
        key += repr(options)
        if self._last is None or self._last[0] != key:
            self._last = None
            self._last = key, w.preview_import(lasers, dark=off, options=options)
        return self._last[1]


def _seen(preview: w.SeriesPreview) -> p.SeriesSeen:
    signal = preview.signal
    return p.SeriesSeen(
        laser=preview.series.laser,
        pictures=list(preview.names),
        steps=[shot.step for shot in preview.series.shots],
        missing=list(preview.missing),
        background=signal.origin,
        noise=signal.noise,
        threshold=signal.threshold,
        line_share=signal.line_share,
    )
