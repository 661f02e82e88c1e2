"""Templates of what is written about an evaluation."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment


def template_environment(**settings: Any) -> "Environment":
    """Where templates are found; settings are those of Jinja's ``Environment``.

    A name that a template uses and nobody gives is an error.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader(__package__),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        **settings,
    )
