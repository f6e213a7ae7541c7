"""Sinks that are sent a message: webhooks, and e-mail."""

from __future__ import annotations

import os
import smtplib
import ssl
from email.message import EmailMessage
from typing import Any
from urllib.parse import SplitResult, unquote, urlsplit

import httpx

from nathlon.lab.sinks import messages
from nathlon.lab.sinks.bulletin import Bulletin
from nathlon.sim.errors import InputError

SMTP = "NATHLON_SMTP"
"""Variable of the environment: `smtp://USER:PASSWORD@HOST:587`, or `smtps://` for TLS from the first byte."""
PORTS = {"smtp": 587, "smtps": 465}
PATIENCE_S = 30.0
"""For each step of an exchange."""


def webhook(bulletin: Bulletin, address: str) -> str:
    """Post the night as JSON; the host that has taken it."""
    return _post(address, bulletin.model_dump(mode="json", exclude={"folder"}))


def slack(bulletin: Bulletin, address: str) -> str:
    """Post the night to a channel of Slack."""
    return _post(address, messages.slack(bulletin))


def teams(bulletin: Bulletin, address: str) -> str:
    """Post the night to a channel of Teams."""
    return _post(address, messages.teams(bulletin))


def mail(bulletin: Bulletin, address: str) -> str:
    """Send the night as plain text; the addresses.

    Raises:
        InputError: if the environment names no mail server.
    """
    server, port = _server()
    user, password = unquote(server.username or ""), unquote(server.password or "")
    letter = EmailMessage()
    letter["Subject"] = f"nathlon {messages.title(bulletin)}"
    letter["To"] = address
    letter["From"] = user if "@" in user else address.partition(",")[0]
    letter.set_content(messages.text(bulletin))
    try:
        with _connected(server.scheme, (str(server.hostname), port)) as connection:
            if user:
                _log_in(connection, user, password)
            connection.send_message(letter)
    except (OSError, smtplib.SMTPException) as error:
        raise InputError(f"{server.hostname} does not take the message: {error}") from None
    return address


def _server() -> tuple[SplitResult, int]:
    """What the environment says of the mail server, and its port."""
    try:
        server = urlsplit(os.environ.get(SMTP, ""))
        port = server.port
        beyond = server.path.strip("/") or server.query or server.fragment
        if server.scheme in PORTS and server.hostname and not beyond:
            return server, port or PORTS[server.scheme]
    except ValueError:
        pass  # it quotes parts of a password
    raise InputError(
        f"{SMTP} is not set to a mail server, expected smtp://HOST:587 or smtp://USER:PASSWORD@HOST:587, "
        "in a password %23 for #, %2F for / and %3F for ?"
    )


def _connected(scheme: str, where: tuple[str, int]) -> smtplib.SMTP:
    context = ssl.create_default_context()
    if scheme == "smtps":
        return smtplib.SMTP_SSL(*where, timeout=PATIENCE_S, context=context)
    connection = smtplib.SMTP(*where, timeout=PATIENCE_S)
    connection.ehlo()
    if connection.has_extn("starttls"):
        connection.starttls(context=context)
    return connection


def _log_in(connection: smtplib.SMTP, user: str, password: str) -> None:
    if not isinstance(connection.sock, ssl.SSLSocket):
        raise InputError("the mail server offers no TLS, without which no password is sent")
    connection.login(user, password)


def _post(address: str, content: Any) -> str:
    try:
        url = httpx.URL(address)
    except httpx.InvalidURL:
        url = httpx.URL()
    if url.scheme not in ("http", "https") or not url.host:
        raise InputError("expected an address that begins with https://, or the $NAME of a variable with one")
    try:
        with httpx.stream("POST", url, json=content, timeout=PATIENCE_S) as response:
            if not response.is_success:
                code = response.status_code
                raise InputError(f"{url.host} answers {code} {httpx.codes.get_reason_phrase(code)}".strip())
    except httpx.HTTPError as error:
        raise InputError(f"{url.host} cannot be reached: {error or type(error).__name__}") from None
    return url.host
