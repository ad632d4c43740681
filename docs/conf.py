"""Settings of the documentation site: `make docs`."""

import os
import sys
from pathlib import Path

# Nothing is compiled in order to write about it.
os.environ["RACE_SERVER_INTERPRET"] = "1"
os.environ["COLUMNS"] = "100"
sys.path.insert(0, str(Path(__file__).parent))

from race_server import __version__

project = "race-server"
author = "race-server contributors"
release = version = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "race_docs.site"]
exclude_patterns = ["_build", "race_docs", "results/*/cells"]
source_suffix = {".md": "markdown"}
default_role = "code"
nitpicky = True
# Types of other libraries and of modules that are not public: signatures name them, pages do not.
nitpick_ignore_regex = [(r"py:.*", r"(?!race_server\.[A-Za-z_]+$).*")]

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3
suppress_warnings = ["myst.header"]  # a page brought from elsewhere may begin at any level

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_class_signature = "separated"

html_theme = "furo"
html_title = f"race-server {release}"
html_static_path = ["_static"]
html_favicon = "_static/icon.svg"
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {"top_of_page_buttons": []}
pygments_style = "friendly"
html_search_language = "en"
html_search_scorer = str(Path(__file__).parent / "_static" / "scorer.js")
