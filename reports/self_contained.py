"""Web pages of one file: style, scripts and data within, nothing from a network."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from nathlon.reports.es_modules import bundle
from nathlon.sim.whole_file import write_whole

TEMPLATES = Path(__file__).parent / "templates"


def template_text(*names: str) -> str:
    """Files of the templates' folder, one after the other."""
    return "\n".join((TEMPLATES / name).read_text("utf-8") for name in names)


def render_page(
    template: str,
    style: str,
    script: str | None = None,
    *,
    libraries: Sequence[str] = (),
    films: bool = False,
    connect: str = "",
    frames: str = "",
    **context: Any,
) -> str:
    """A page's HTML. Its policy admits only its style and its scripts, by their hashes.

    Args:
        template: a file of the templates' folder, which finds `policy`, `style`, `libraries` and `script`
            beside its own.
        style: what stands in its style element.
        script: the module of the templates' folder that is the page's script, with all from which it imports.
        libraries: scripts before it, in their order.
        films: whether videos beside the page may be played.
        connect: addresses to which the page may connect; none by default.
        frames: address whose pages it may show in frames; none by default.
        **context: what else the template needs.
    """
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    own = [] if script is None else [bundle(TEMPLATES, script)]
    scripts = [*libraries, *own]
    policy = ["default-src 'none'", f"style-src {_digest(style)}"]
    if scripts:
        policy.append(f"script-src {' '.join(map(_digest, scripts))}")
    policy += ["img-src data:", *(["media-src 'self'"] if films else [])]
    policy += [f"connect-src {connect}"] if connect else []
    policy += [f"frame-src {frames}"] if frames else []
    return environment.get_template(template).render(
        policy="; ".join([*policy, "base-uri 'none'", "form-action 'none'"]),
        style=Markup(style),
        libraries=[Markup(library) for library in libraries],
        script=Markup(*own),
        **context,
    )


def script_data(value: Any) -> Markup:
    """JSON that can stand in a script element: nothing in it ends the element or begins another.

    Raises:
        ValueError: for NaN and infinities, which JSON does not have.
    """
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c"))


def write_page_file(html: str, path: Path) -> Path:
    """Write a page, whole or not at all, into a folder that is made if need be; return its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, html)
    return path


def _digest(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
