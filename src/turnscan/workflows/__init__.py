"""Verbs as functions: typed options in, results out; the doors only translate."""

from turnscan.workflows._section import (
    SECTION_SUFFIXES,
    cuts_of,
    section,
    section_file,
    section_in_words,
)

__all__ = ["SECTION_SUFFIXES", "cuts_of", "section", "section_file", "section_in_words"]
