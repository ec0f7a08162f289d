"""The documentation site: `make docs` builds it.

Sources are the repository's own Markdown pages where they are, so that their links hold on a
code host and here; nothing is fetched from the network, neither by the build nor by a reader's
browser: MathJax is copied into the site.
"""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "site"))

project = "needlefem"
author = "needlefem developers"
version = release = version_of("needlefem")
language = "en"
nitpicky = True
smartquotes = False

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
    "needlefem_site",
]
root_doc = "docs/index"
include_patterns = [
    "README.md",
    "CHANGELOG.md",
    "docs/**",
    "cases/README.md",
    "cases/*/README.md",
    "verification/README.md",
]
exclude_patterns = [".venv", ".git", "out", "docs/gallery/**", "docs/site/**"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}

html_theme = "furo"
html_show_copyright = False
html_title = f"needlefem {version}"
html_static_path = ["site/static"]
html_css_files = ["needlefem.css"]
html_extra_path = ["site/extra", "../out/docs-verification"]
html_theme_options = {"navigation_with_keys": True}

myst_heading_anchors = 3
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_fence_as_directive = ["math"]  # fences of this kind are equations on code hosts, too
highlight_language = "text"  # every other block names its language

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # numpydoc's sections have them, with shape and unit
numpydoc_show_class_members = False

sphinx_gallery_conf = {
    "examples_dirs": "docs/gallery",
    "gallery_dirs": "docs/examples",
    "filename_pattern": "/plot_",
    "image_scrapers": ("needlefem_site.pictures",),
    "reset_modules": ("needlefem_site.forget_pictures",),
    "show_memory": False,
    "write_computation_times": False,
    "min_reported_time": 1000,
    "download_all_examples": False,
    "show_signature": False,
    "abort_on_example_error": True,
}
