#!/bin/bash
# Workers on ten nodes of a Slurm cluster: sbatch slurm.sh postgresql+psycopg://racing@db.example/nathlon
# Start it before or after the selection; each worker ends when nothing has waited for five minutes.
#SBATCH --job-name=nathlon-worker
#SBATCH --array=0-9
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=16
#SBATCH --mem=32G
#SBATCH --time=08:00:00
#SBATCH --requeue
#SBATCH --output=worker-%A-%a.log
set -eu

store=${1:?the URL of the store, with its password in ~/.pgpass}

# Compiled kernels stay on the node: caches on a network drive get in each other's way.
export XDG_CACHE_HOME=${TMPDIR:-/tmp}/cache-$USER

# srun hands the SIGTERM on that Slurm sends at the end, so that the worker gives its matches back.
exec srun nathlon worker "$store" --workers "$SLURM_CPUS_PER_TASK" --wait 300
