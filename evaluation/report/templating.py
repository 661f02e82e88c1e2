"""Templates of the report, the card and other pages."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment


def template_environment(*packages: str, **settings: Any) -> "Environment":
    """Where templates are found: in some packages, and here.

    Settings are those of Jinja's ``Environment``.

    A name that a template uses and nobody gives is an error.
    """
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=ChoiceLoader([PackageLoader(name) for name in (*packages, __package__)]),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        **settings,
    )
