"""What a page is made of, whatever the format that it is written in. Texts are plain: formats escape them."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Text:
    """A paragraph; `warning` ones stand out."""

    text: str
    warning: bool = False


@dataclasses.dataclass(frozen=True)
class Items:
    """A list of short texts."""

    items: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Table:
    """Rows of cells below a head, with a caption; columns of numbers stand to the right."""

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclasses.dataclass(frozen=True)
class Picture:
    """A PNG with a caption, and in words what it shows."""

    png: bytes
    caption: str
    alt: str


@dataclasses.dataclass(frozen=True)
class Code:
    """Lines as they are."""

    text: str


Block = Text | Items | Table | Picture | Code


@dataclasses.dataclass(frozen=True)
class Section:
    """A heading and what stands below it."""

    title: str
    blocks: tuple[Block, ...]


@dataclasses.dataclass(frozen=True)
class Page:
    """A title and sections."""

    title: str
    sections: tuple[Section, ...]
