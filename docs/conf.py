"""Sphinx: the site that `make docs` builds from these pages, with every warning an error."""

import shadowbench

project = "shadowbench"
author = "the shadowbench authors"
release = shadowbench.__version__
html_title = "shadowbench"
html_show_copyright = False

extensions = ["myst_parser", "sphinx.ext.autodoc"]
html_theme = "furo"
templates_path = ["_templates"]
html_sidebars = {  # the theme's, below links to the reports that `make site` puts beside these pages
    "**": [
        "results.html",
        *(f"sidebar/{one}.html" for one in ("brand", "search", "scroll-start", "navigation", "scroll-end")),
    ]
}
myst_enable_extensions = ["html_image"]  # pictures with a width, in tables
myst_heading_anchors = 3  # links to headings as on GitHub
default_role = "code"  # docstrings mark names with single backquotes
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
# Types of other packages, whose inventories need a network, and of modules that have no page.
nitpick_ignore_regex = [
    ("py:.*", r"(numpy|np|pandas|pd|moderngl|pathlib|collections|contextlib|typing|shadowbench\.\w+)\..*"),
    ("py:class", "Subject"),
]
