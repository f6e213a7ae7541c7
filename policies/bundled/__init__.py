"""The checkpoints that come with nathlon; README.md tells how they were made."""

from pathlib import Path

BUNDLED = Path(__file__).parent
