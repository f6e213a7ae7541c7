"""What lies at an address: files that can be listed without fetching them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, Protocol


class Listed(NamedTuple):
    """A file as a listing tells of it.

    Attributes:
        mark: changes when the contents do: a digest, or else what the place has; None where it has nothing:
            the file is then fetched every time.
        size: bytes; None where the listing does not say.
    """

    mark: str | None
    size: int | None


class Remote(Protocol):
    """A place with files."""

    def listing(self) -> Mapping[str, Listed]:
        """All files by their paths from the address, with `/` between; raises any error."""

    def fetch(self, path: str, to: Path) -> None:
        """Write a file of the listing to a path of this machine; raises any error."""
