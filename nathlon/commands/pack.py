"""`nathlon pack` and `nathlon verify`."""

from __future__ import annotations

import secrets
import sys
from pathlib import Path
from typing import Annotated

import typer

from nathlon.commands.options import AsJson, Workers, WorldName
from nathlon.commands.selection import stoppable
from nathlon.selection.bounds import LARGEST_SEED
from nathlon.sim.whole_file import check_output
from nathlon.terminal import print_json, say, tell

FAILED = 1
"""Exit code where a pack is not what it claims to be."""


def pack(
    run: Annotated[Path, typer.Argument(help="Folder of the run, or of the night.")],
    out: Annotated[Path | None, typer.Option(help="The file; NAME.nathlon.zip by default.")] = None,
    store: Annotated[
        str | None, typer.Option(help="Store of the run, path or URL; that in the folder by default.")
    ] = None,
    key: Annotated[Path | None, typer.Option(help="SSH key that signs it.")] = None,
    as_json: AsJson = False,
) -> None:
    """Write a run into one file that anybody can verify: report, results, checkpoints, races to look at."""
    from nathlon.arena.store import Store
    from nathlon.lab.pack.packing import pack_run

    target = out or Path(f"{run.resolve().name}.nathlon.zip")
    check_output(target, is_file=True)
    with Store.open(store or run / "store.sqlite") as opened:
        manifest = pack_run(run, opened, target, key)
    tell({"file": target, "files": len(manifest.files), "signed": "yes" if key else "no"}, as_json)


def verify(
    file: Annotated[Path, typer.Argument(help="What nathlon pack has written.")],
    sample: Annotated[int, typer.Option(min=0, max=100_000, help="Matches to race again.")] = 8,
    seed: Annotated[
        int | None,
        typer.Option(min=0, max=LARGEST_SEED, help="Draws them; another one each time by default."),
    ] = None,
    signers: Annotated[
        Path | None, typer.Option(help="Allowed signers of OpenSSH, of whom one must have signed it.")
    ] = None,
    workers: Workers = None,
    world: WorldName = None,
    as_json: AsJson = False,
) -> None:
    """Say whether a packed run is what it claims to be, by racing a sample of its matches again.

    Exit code 0: it is. 1: something disagrees. 2: it is no pack, was changed, or is not signed as asked for.
    """
    from nathlon.arena.pool import Pool
    from nathlon.arena.world_finding import RACING
    from nathlon.lab.pack.verifying import RACED_AGAIN, verify_pack
    from nathlon.terminal.progress import stage_progress, worker_count

    with (
        stoppable("The same command begins anew."),
        Pool(worker_count(workers)) as pool,
        stage_progress(not as_json, (RACED_AGAIN,)) as on_match,
    ):
        worlds = (RACING,) if world is None else (RACING, world)
        drawn = secrets.randbits(32) if seed is None else seed
        found = verify_pack(file, sample, drawn, signers, pool, on_match, worlds)
    if as_json:
        print_json(found._asdict())
    else:
        say(f"Run          {found.run}")
        say(f"Signed by    {found.signed_by or 'nobody'}")
        say(f"Raced again  {found.again} of {found.matches} matches came to the same (--seed {found.seed})")
        for name in found.missing:
            say(f"Not in it    {name}, which was gone when the run was decided: not raced again")
        for fault in found.faults:
            say(f"Disagrees    {fault}")
        say(f"Outcome      {'Something disagrees.' if found.faults else 'It is what it claims to be.'}")
    sys.exit(FAILED if found.faults else 0)
