"""Modules of pages, for tests that call what is in them: pages keep all names to themselves."""

from __future__ import annotations

from nathlon.reports.es_modules import bundle
from nathlon.reports.self_contained import TEMPLATES


def module(name: str) -> str:
    """An expression whose value has what a module exports, for a page's `evaluate`."""
    return f"(() => {{ {bundle(TEMPLATES, name)} return $modules['{name}']; }})()"
