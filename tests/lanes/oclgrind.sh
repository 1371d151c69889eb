#!/bin/sh
# oclgrind.sh BUFFERS PROGRAM
# Runs a test program on the device that Oclgrind simulates. It fails when the program fails, and
# when Oclgrind has anything to report: that alone would leave the exit code at 0.
#
# Two errors of Oclgrind 21.10 are kept away: BUFFERS is the library of oclgrind_buffers.c, and
# kernels are compiled without optimisation, as its check for uninitialised values reads stray memory
# at the undefined lanes of the vector shuffles that the optimiser makes. Groups are of 32 work-items at
# most: the simulator takes the longer, the more share a term.
set -u
buffers=$1
shift
if ! command -v oclgrind >/dev/null; then
    echo "skipped: oclgrind is not installed"
    exit 77
fi
log=$(mktemp) || exit 1
trap 'rm -f "$log"' EXIT
export OVOID_DEVICE=Oclgrind OVOID_CACHE=off OVOID_POOL=off
oclgrind --max-wgsize 32 --build-options -cl-opt-disable --data-races --uninitialized --log "$log" \
    sh -c 'LD_PRELOAD="$0:$LD_PRELOAD" exec "$@"' "$buffers" "$@"
status=$?
if [ -s "$log" ]; then
    echo "Oclgrind reports:"
    head -n 100 "$log"
    [ "$status" -ne 0 ] || status=1
fi
exit "$status"
