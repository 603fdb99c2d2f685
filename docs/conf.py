"""How Sphinx builds the documentation site: `scripts/docs`."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from generated import write_pages, write_rest  # noqa: E402 - beside this file

from etac_ros import __version__  # noqa: E402

project = "etac_ros"
author = "etac_ros maintainers"
release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "numpydoc"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build"]
html_theme = "furo"
html_show_copyright = False
html_title = f"etac_ros {__version__}"
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
autodoc_typehints = "none"  # numpydoc says it in words
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
# Links to files of the repository that are no pages of the site.
suppress_warnings = ["myst.xref_missing"]


def setup(app):
    """Write the pages that are made of docstrings and parameters before Sphinx looks for pages."""

    def write(_):
        write_pages(HERE / "reference" / "generated")
        write_rest(HERE, HERE / "reference" / "generated" / "more.rst")

    app.connect("builder-inited", write)
