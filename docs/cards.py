"""Sphinx directive ``kinarm-card``: the card of a policy, evaluated when the page is built."""

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from kinarm.evaluation import EvaluationRequest, evaluation_document
from kinarm.evaluation.report.card import policy_card


def make_card(policy: str) -> str:
    """Evaluate a shipped policy beside the oracle, and describe it."""
    evaluations = EvaluationRequest(policies=(policy,)).evaluate()
    command = f"kinarm-eval --policy {policy} --card {policy}.md"
    return policy_card(policy, evaluation_document(evaluations, command), evaluations[0])


class KinarmCard(SphinxDirective):
    """Show the card of a shipped policy, such as ``ppo-tuned-both-seed0``, as its text."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        text = make_card(self.arguments[0])
        return [nodes.literal_block(text, text, language="markdown")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("kinarm-card", KinarmCard)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
