"""XML without trust: no entity is expanded, nothing else is opened, and size and depth have bounds."""

from __future__ import annotations

from xml.etree.ElementTree import Element
from xml.parsers import expat

from nathlon.sim.errors import InputError

DEEPEST, MOST_ELEMENTS = 64, 1_000_000


def parse(text: str) -> Element:
    """The root of an XML text, names without prefixes; comments are left out.

    What a document type declares outside the file is not read, nor put in where it is referred to.

    Raises:
        InputError: if it is not well-formed, declares entities with contents of their own, or is too large
            or too deep.
    """
    parser = expat.ParserCreate()
    parser.buffer_text, parser.buffer_size = True, 1 << 20
    open_elements: list[Element] = []
    roots: list[Element] = []
    count = 0

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if len(open_elements) >= DEEPEST or count > MOST_ELEMENTS:
            raise InputError(
                f"line {parser.CurrentLineNumber}: <{name[:40]}>: expected at most "
                f"{MOST_ELEMENTS:,} elements, {DEEPEST} deep"
            )
        element = Element(plain(name), {plain(key): value for key, value in attributes.items()})
        element.set("at line", str(parser.CurrentLineNumber))
        (open_elements[-1].append if open_elements else roots.append)(element)
        open_elements.append(element)

    def end(_: str) -> None:
        open_elements.pop()

    def data(text: str) -> None:
        if open_elements and not len(open_elements[-1]):
            open_elements[-1].text = (open_elements[-1].text or "") + text

    def declared(name: str, _: int, value: str | None, *__: object) -> None:
        if value is not None:
            raise InputError(
                f"line {parser.CurrentLineNumber}: the entity {name[:40]!r} is declared, "
                "expected plain XML without"
            )

    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, data
    parser.EntityDeclHandler = declared
    parser.ExternalEntityRefHandler = lambda *_: 1
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise InputError(
            f"line {error.lineno}: not well-formed XML ({expat.ErrorString(error.code)}), "
            "expected a whole file"
        ) from None
    return roots[0]


def plain(name: str) -> str:
    """A name without the prefix of its namespace."""
    return name.rpartition(":")[2]


def place(element: Element) -> str:
    """Where an element stands in the file."""
    return f"line {element.get('at line')}"


def text_at(element: Element, path: str) -> str | None:
    """The text of the first element on a path, `centerline/x`; none if there is none."""
    found = element.find(path)
    return None if found is None else found.text
