"""The checkpoints that come with nathlon; README.md tells how they were made."""

from pathlib import Path

BUNDLED = Path(__file__).parent


def generalist() -> Path:
    """The checkpoint for any car on any circuit that has learnt longest."""
    from nathlon.policies.checkpoint import read_card  # whoever only names the folder need not wait for it

    return max((BUNDLED / "generalist").glob("*.safetensors"), key=lambda path: read_card(path).step or 0)
