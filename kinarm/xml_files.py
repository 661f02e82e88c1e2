"""The only reader of XML: what claims more than it holds is refused before anything is built."""

from xml.etree import ElementTree
from xml.parsers import expat

MOST_ELEMENTS, DEEPEST = 200_000, 100
"""Elements of a document at most, and levels of nesting."""


def parse_xml(content: bytes) -> ElementTree.Element:
    """The root of a document.

    Raises
    ------
    ValueError
        If it is damaged, or claims more than it holds; see `check_xml`.
    """
    check_xml(content)
    try:
        return ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise ValueError(str(error)) from error


def check_xml(content: bytes) -> None:
    """Refuse a document that no honest program writes.

    Entities of its own, which can grow without end; nesting and elements without end; and counts,
    as of the numbers of a Collada file, that are larger than the file.

    Raises
    ------
    ValueError
        With the reason.
    """
    parser = expat.ParserCreate()
    depth = elements = 0

    def refuse_types(*_: object) -> None:
        raise ValueError("it defines entities or types of its own")

    def enter(_: str, attributes: dict[str, str]) -> None:
        nonlocal depth, elements
        depth, elements = depth + 1, elements + 1
        if depth > DEEPEST or elements > MOST_ELEMENTS:
            raise ValueError(f"it has more than {DEEPEST} levels or {MOST_ELEMENTS} elements")
        for name in ("count", "stride", "offset"):
            given = attributes.get(name, "0")
            if given.strip("-").isdigit() and int(given[:20]) > len(content):
                raise ValueError(f"{name} {given[:20]!r} is more than it holds")

    def leave(_: str) -> None:
        nonlocal depth
        depth -= 1

    parser.StartDoctypeDeclHandler = refuse_types
    parser.StartElementHandler = enter
    parser.EndElementHandler = leave
    try:
        parser.Parse(content, True)
    except (expat.ExpatError, LookupError) as error:  # the latter of an unknown encoding
        raise ValueError(str(error)) from error
