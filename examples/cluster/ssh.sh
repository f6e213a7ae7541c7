#!/bin/bash
# Workers on machines that ssh reaches:
#   ssh.sh postgresql+psycopg://racing@db.example/nathlon one.example two.example
# nathlon is on the path of each machine, and the password of the store in its ~/.pgpass.
set -eu

store=${1:?the URL of the store}
shift

for machine in "$@"; do
    # With a terminal, so that Ctrl-C here and a lost connection end the worker there.
    ssh -tt "$machine" nathlon worker "$(printf %q "$store")" --wait 300 < /dev/null > "worker-$machine.log" 2>&1 &
done
wait
