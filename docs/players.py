"""Sphinx directive ``kinarm-replay``: trials that are run and recorded when the page is built."""

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from kinarm.evaluation import ReplayRequest
from kinarm.viewer import ReplayPage, replay_page


def numbers(text: str) -> list[int]:
    """Read whole numbers separated by spaces."""
    return [int(word) for word in text.split()]


def make_replay(policy: str, problem: str, trials: list[int], ghost: str | None) -> ReplayPage:
    """Let one or two policies face some trials."""
    who = {"compare": (policy, ghost)} if ghost else {"policy": policy}
    first, *others = ReplayRequest(problem=problem, trial=tuple(trials), **who).recordings()
    return replay_page(first, ghosts=others[0] if others else ())


class KinarmReplay(SphinxDirective):
    """Show trials of a policy, such as ``ars-tuned-both``, on a problem."""

    required_arguments = 2
    option_spec = {"trials": numbers, "ghost": directives.unchanged}  # noqa: RUF012

    def run(self) -> list[nodes.Node]:
        policy, problem = self.arguments
        page = make_replay(policy, problem, self.options["trials"], self.options.get("ghost"))
        return [nodes.raw("", page._repr_html_(), format="html")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("kinarm-replay", KinarmReplay)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
