"""What a benchmark leaves: figures, and where they come from, in a JSON file that the page of figures reads.

Committed results lie in `benchmarks/results/`; `python -m benchmarks.page` makes docs/benchmarks.md of them.
"""

from __future__ import annotations

import json
import platform
import shlex
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from nathlon.sim.errors import InputError
from nathlon.sim.validation import first_fault
from nathlon.sim.whole_file import whole_file

RESULTS = Path(__file__).with_name("results")
ALWAYS = ("numba", "numpy", "torch")
"""Packages whose version every result tells."""


class Result(BaseModel):
    """A benchmark's figures.

    Attributes:
        command: what made them, to be run again.
        date: when, ISO 8601; of a transcribed result, when it was written to the page.
        machine: processor, cores, and whatever else matters to times.
        versions: by package.
        source: `benchmark`, or what the figures were transcribed from.
        figures: as the benchmark's docstring says.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    command: str
    date: str
    machine: str
    versions: dict[str, str]
    source: str = "benchmark"
    figures: Any


def processor() -> str:
    """The processor's name as the system gives it, and the operating system."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text("utf-8").splitlines() if cpuinfo.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{len(names)} x {names[0]}, {platform.platform()}" if names else platform.platform()


def write_result(path: Path, figures: Any, versions: Mapping[str, str] | None = None) -> None:
    """Write the figures of the running benchmark, whole or not at all.

    Args:
        figures: anything that JSON can hold.
        versions: of further programs that matter, by name.
    """
    module = getattr(sys.modules["__main__"].__spec__, "name", "") or Path(sys.argv[0]).stem
    result = Result(
        command=shlex.join(["python", "-m", module.removesuffix(".__main__"), *sys.argv[1:]]),
        date=datetime.now(UTC).date().isoformat(),
        machine=processor(),
        versions={
            "python": platform.python_version(),
            **{name: version(name) for name in ALWAYS},
            **(versions or {}),
        },
        figures=figures,
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as partial:
        partial.write_text(json.dumps(result.model_dump(mode="json"), indent=1) + "\n", "utf-8")


def read_result(path: Path) -> Result:
    """A result.

    Raises:
        InputError: if it cannot be read.
    """
    try:
        return Result.model_validate_json(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        raise InputError(f"{path}: {first_fault(error, Result)}") from None
