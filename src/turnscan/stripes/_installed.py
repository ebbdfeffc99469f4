"""Stripe detectors that other packages add, by the names of their entry points."""

from __future__ import annotations

from turnscan.errors import InputError
from turnscan.plugins import Plugin, find_plugin, plugin_names

GROUP = "turnscan.detectors"
"""The entry-point group. An entry is a `turnscan.stripes.Detector`."""


def detector_names() -> tuple[str, ...]:
    """The detectors that installed packages add, by the names of their entry points."""
    return plugin_names(GROUP)


def installed_detector(name: str) -> Plugin:
    """The detector of that name.

    Raises InputError where none is installed, PluginError where it cannot be loaded.
    """
    found = find_plugin(GROUP, name)
    if found is None:
        raise InputError(f"no stripe detector {name!r}", hint="install the package it comes from")
    if not callable(found.value):
        raise found.failure(f"it gives a {type(found.value).__name__}, not a function")
    return found
