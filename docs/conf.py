"""How Sphinx builds this folder (`make docs`): pages in MyST Markdown, tutorials run, references generated.

Nothing is fetched: fonts are the reader's own, no page needs a script from elsewhere, and no formula needs MathJax.
"""

import os
import shutil
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))
# the tutorials run `pbrdf` as a reader would: the one beside this Python
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
os.environ["COLUMNS"] = "90"  # of a command's output: the width of a page
# what the kernel of a tutorial runs first
os.environ["IPYTHONDIR"] = str(HERE / "_build" / "ipython")
startup = HERE / "_build" / "ipython" / "profile_default" / "startup"
startup.mkdir(parents=True, exist_ok=True)
shutil.copy(HERE / "_ext" / "sh_cells.py", startup)

from pbrdf.version import __version__  # noqa: E402

project = "pbrdf"
author = "the pbrdf developers"
version = release = __version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "generated_pages"]
exclude_patterns = ["_build", "examples"]
# indented blocks are commands and tables of text, not Python
highlight_language = "none"

# deflist: "term, new line, colon" in the pages of commands; anchors: links to headings, as GitHub makes them
myst_enable_extensions = ["deflist"]
myst_heading_anchors = 4

nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints = "description"
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 88
napoleon_google_docstring = False
napoleon_use_rtype = False

smartquotes = False

html_theme = "furo"
html_title = f"pbrdf {version}"
html_copy_source = False
html_show_copyright = False
html_theme_options = {"footer_icons": []}
