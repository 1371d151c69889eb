#!/bin/sh
# oclgrind.sh PROGRAM
# Runs a test program on the device that Oclgrind simulates. It fails when the program fails, and
# when Oclgrind has anything to report: that alone would leave the exit code at 0.
set -u
if ! command -v oclgrind >/dev/null; then
    echo "skipped: oclgrind is not installed"
    exit 77
fi
log=$(mktemp) || exit 1
trap 'rm -f "$log"' EXIT
OVOID_DEVICE=Oclgrind OVOID_CACHE=off oclgrind --data-races --uninitialized --log "$log" "$@"
status=$?
if [ -s "$log" ]; then
    echo "Oclgrind reports:"
    head -n 100 "$log"
    [ "$status" -ne 0 ] || status=1
fi
exit "$status"
