"""What makes a policy the one that it is: known without opening it, so that nothing of it runs."""

from __future__ import annotations

from pathlib import Path

from nathlon.policies.checkpoint import checkpoint_id
from nathlon.policies.policy_file import read_policy_file
from nathlon.policies.sources import COMPOSITE, DRIVER, HUMAN, MPPI, OBJECT, PLUGIN, RANDOM, ROLES
from nathlon.policies.sources.composite import CompositeSource
from nathlon.policies.sources.handed_over import object_id
from nathlon.policies.sources.normalisation import companions, identity_with
from nathlon.policies.sources.planned import PlannedSource
from nathlon.policies.sources.plugin import plugin_id
from nathlon.policies.sources.roles import RolesSource
from nathlon.sim.errors import InputError


def is_still(source: str, identity: str) -> bool:
    """Whether the policy that a user calls by a path or a name is there, and has this id."""
    try:
        return policy_id(source) == identity
    except InputError:
        return False


def policy_id(source: str) -> str:
    """The id of the policy that a user calls by a path or a name.

    That of a built-in driver is its name, of a file of weights the SHA-256 of its bytes, with those of what
    lies beside it and decides what it sees, of a plugin, a composite, a planner or policies by role that of
    all that decides how it drives, of an object that of what it consists of.

    Raises:
        InputError: if there is no such file or plugin.
    """
    kind, _, name = source.partition(":")
    if kind == DRIVER or source == RANDOM:
        return source
    if kind == PLUGIN:
        return plugin_id(name)
    if kind == OBJECT:
        return object_id(source)
    if kind == HUMAN:
        return checkpoint_id(Path(name))
    if kind == MPPI:
        return PlannedSource.read(source).identity
    if source.endswith(ROLES):
        roles = RolesSource.read(Path(source))
        return roles.identity([policy_id(part) for part in roles.sources.values()])
    if source.endswith(COMPOSITE):
        composite = CompositeSource.read(Path(source))
        return composite.identity([policy_id(part) for part in composite.sources])
    path = Path(source)
    return identity_with(read_policy_file(path), companions(path).read())
