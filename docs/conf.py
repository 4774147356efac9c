"""The documentation as a site: `tests/docs.sh` builds it with Sphinx and MyST, which read the Markdown pages as they are.

Why Sphinx: one tool renders Markdown, notebooks and the Python package's docstrings, checks the links between pages, and searches.
"""

project = "ROS-Causal"
extensions = ["myst_nb", "sphinx.ext.autosectionlabel"]
exclude_patterns = ["_build", "studies/*.csv"]
html_theme = "furo"
html_title = project
html_favicon = "../icon.svg"
# Notebooks are run by tests/python.sh; here they are shown as they were saved.
nb_execution_mode = "off"
# Headings are link targets, as on GitHub.
myst_heading_anchors = 4
# Pictures in HTML are copied to the site, too.
myst_enable_extensions = ["html_image"]
myst_links_external_new_tab = True
autosectionlabel_prefix_document = True
suppress_warnings = ["autosectionlabel.*", "misc.highlighting_failure", "myst.header"]
