"""Where a server is reached."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass

from nathlon.reports.web_viewer import LOOPBACK

DEFAULT_PORTS = {False: 80, True: 443}
"""Which browsers do not name, with TLS and without."""


@dataclass(frozen=True)
class Address:
    """Where a server is reached.

    Attributes:
        host: name or IP address by which browsers call it.
        port: on which it listens.
        tls: whether it speaks TLS.
    """

    host: str
    port: int
    tls: bool = False

    @property
    def authority(self) -> str:
        """As browsers write it into the header Host."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return host if self.port == DEFAULT_PORTS[self.tls] else f"{host}:{self.port}"

    @property
    def origin(self) -> str:
        """Of its pages."""
        return f"http{'s' if self.tls else ''}://{self.authority}"

    @property
    def socket(self) -> str:
        """Of its WebSockets."""
        return f"ws{'s' if self.tls else ''}://{self.authority}"

    @property
    def interface(self) -> str | None:
        """On which it listens: a name that is not this machine's own is on all, None."""
        if self.host == "localhost":
            return LOOPBACK
        try:
            return str(ipaddress.ip_address(self.host))
        except ValueError:
            return None


def is_loopback(host: str) -> bool:
    """Whether a name or address is that of this machine for itself."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def is_unspecified(host: str) -> bool:
    """Whether it stands for all addresses of a machine, and so is none by which it is reached."""
    try:
        return ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return False
