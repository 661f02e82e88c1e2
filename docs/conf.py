"""Sphinx configuration: the site builds offline, and a warning fails it."""

import re
import sys
import warnings
from pathlib import Path

import matplotlib as mpl
from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx_autodoc_typehints import process_signature

mpl.use("Agg")  # pages run without a display
sys.path.insert(0, str(Path(__file__).parent))  # extensions

import kinarm

# sphinx-autodoc-typehints calls what Sphinx 10 will rename.
warnings.filterwarnings("ignore", message=".*set_application.*is deprecated")

project = "kinarm"
author = "The kinarm developers"
copyright = "The kinarm developers"  # noqa: A001  (Sphinx's name)
version = release = kinarm.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_autodoc_typehints",
    "api_index",
    "commands",
    "comments",
    "notebooks",
    "runs",
]
exclude_patterns = ["_build"]
nitpicky = True
# Docstrings put names of ours between single backticks.
default_role = "py:obj"

myst_enable_extensions = ["alert"]
myst_heading_anchors = 3

napoleon_google_docstring = False
napoleon_use_param = False  # types such as "ndarray, shape (n, 3)" are text and not names
napoleon_use_rtype = False
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
typehints_use_signature_return = True
typehints_document_rtype = False
always_use_bars_union = True
maximum_signature_line_length = 76

# Types of other projects: their inventories would have to be fetched.
nitpick_ignore_regex = [
    (r"py:.*", r"(numpy|pinocchio|coal|gymnasium|msgspec|pathlib|collections|typing)\..*"),
    (r"py:data", r"Ellipsis"),
    (r"py:class", r"kinarm\.(observation_layout\.ObservationLayout|viewer\.html_page\.HtmlPage)"),
    (r"py:class", r"Figure"),  # matplotlib, which is imported when first used
    # NumPy's, where annotations are kept as they are written.
    (r"py:class", r"NDArray|ndarray|Array|np\.\w+"),
    (r"py:class", r".*\.[A-Z]\w*T"),  # type variables
    # Packages, the replay page's, and what the reference leaves out.
    (r"py:obj", r"kinarm\.(policies|evaluation|state|kernels\.\w+)"),
    # What only kernels look into.
    (r"py:class", r"kinarm\.(kernels\.session\.Session|episodes\.Rules|goals\.Goals)"),
    (r"py:class", r"kinarm\.collision\.Step"),
]

html_theme = "furo"
html_title = f"kinarm {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False


def _attribute_types_as_text(
    _app: object, _what: str, _name: str, _obj: object, _options: object, lines: list[str]
) -> None:
    """Put an attribute's type before its description, as text: its words are not all names."""
    description = 0
    for number, line in enumerate(lines):
        if line.lstrip().startswith(".. attribute::"):
            description = number + 2
        elif match := re.match(r"^(\s+):type: (.*)$", line):
            indent, words = match.groups()
            lines[description] = f"{indent}*{words}*: {lines[description].lstrip()}"
            lines[number] = ""


ARRAY = re.compile(
    r"ndarray\[tuple\[[~.\w]*Any, \.\.\.\], [~.\w]*dtype\[[~.\w]+\]\]|NDArray\[np\.\w+\]"
)


def _shorten_signature(
    app: Sphinx, what: str, name: str, obj: object, options: object, *written: str
) -> tuple[str | None, str | None]:
    """Write array types as their names: before the length of a signature tells how it is set."""
    made = process_signature(app, what, name, obj, options, *written) or written
    signature, returned = (part and ARRAY.sub("ndarray", part) for part in made)
    return signature, returned


def _shorten_annotations(_app: object, doctree: nodes.document) -> None:
    """Write array types as their names and made defaults as dots; leave out a None returned."""
    kinds = (addnodes.desc_annotation, addnodes.desc_returns)
    for node in list(doctree.findall(lambda node: isinstance(node, kinds))):
        text = "".join(child.astext() for child in node.children)
        short = ARRAY.sub("ndarray", text)
        if isinstance(node, addnodes.desc_returns) and text == "None":
            node.parent.remove(node)
        elif short != text:
            node.children = [nodes.Text(short)]
    for node in doctree.findall(nodes.inline):
        if "default_value" in node["classes"] and node.astext() == "<factory>":
            node.children = [nodes.Text("...")]


def setup(app: Sphinx) -> None:
    """Mend what napoleon and autodoc write."""
    app.connect("autodoc-process-docstring", _attribute_types_as_text, priority=900)
    app.connect("autodoc-process-signature", _shorten_signature, priority=400)
    app.connect("doctree-read", _shorten_annotations)
