"""Sphinx directive ``kinarm-replay``: trials that are run and recorded when the page is built."""

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from kinarm import Simulator
from kinarm.evaluation import TrialSet, find_entrants, oracle_bounds, record
from kinarm.viewer import ReplayPage, replay_page


def numbers(text: str) -> list[int]:
    """Read whole numbers separated by spaces."""
    return [int(word) for word in text.split()]


def make_replay(policy: str, task: str, trials: list[int], ghost: str | None) -> ReplayPage:
    """Let one or two policies face some trials."""
    faced = TrialSet.draw(Simulator("paper", task), max(trials) + 1, seed=0)
    bounds = oracle_bounds(faced)
    runs = [
        record(find_entrants(name)[0], faced, trials, bounds=bounds)
        for name in (policy, ghost)
        if name is not None
    ]
    return replay_page(runs[0], ghosts=runs[1] if len(runs) > 1 else ())


class KinarmReplay(SphinxDirective):
    """Show trials of a policy, such as ``ars-tuned-right``, on a task."""

    required_arguments = 2
    option_spec = {"trials": numbers, "ghost": directives.unchanged}  # noqa: RUF012

    def run(self) -> list[nodes.Node]:
        policy, task = self.arguments
        page = make_replay(policy, task, self.options["trials"], self.options.get("ghost"))
        return [nodes.raw("", page._repr_html_(), format="html")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("kinarm-replay", KinarmReplay)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
