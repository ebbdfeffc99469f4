"""How Sphinx builds the documentation."""

import gc
import sys
from pathlib import Path

from turnscan import __version__

project = "turnscan"
author = "the turnscan authors"
copyright = "the turnscan authors"
version = release = __version__

# A document is a tree of some million nodes that lives as long as it is worked on: Python's search
# for garbage, after each 700 of them, finds none and takes a good part of the build.
gc.set_threshold(200_000, 20, 20)

sys.path.insert(0, str(Path(__file__).parent))
extensions = [
    "myst_parser",
    "notebook_cells",
    "quick_build",
    "verb_tables",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
]
napoleon_google_docstring = False
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"turnscan {__version__}"
exclude_patterns = ["_build"]

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": False}
