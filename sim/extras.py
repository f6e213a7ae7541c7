"""What is installed only for some purposes: the extras of `pyproject.toml`."""

from __future__ import annotations

from importlib.util import find_spec

from nathlon.sim.errors import InputError


def need(module: str, extra: str, what: str) -> None:
    """Say how to install a module, if it is not there.

    Args:
        module: name of the module.
        extra: that brings it.
        what: needs it, in the words of the user.

    Raises:
        InputError: if there is no such module.
    """
    if find_spec(module) is None:
        raise InputError(
            f"{what} needs {module}, which the extra {extra} installs: "
            f"pip install -e '.[{extra}]' in the checkout of nathlon"
        )
