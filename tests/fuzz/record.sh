#!/bin/sh
# record.sh SECONDS [NAME...]: runs these harnesses, or all, one after the other for so long each, and
# prints what bench/results/fuzz.csv holds. Builds are those of the preset 'fuzz'; FUZZ_CORPUS names a
# folder where what is learnt stays.
set -eu
seconds=$1
shift
here=$(cd "$(dirname "$0")" && pwd)
programs=$here/../../build/fuzz/tests/fuzz
[ $# -gt 0 ] || set -- assembly mmcif model pdb pqr radii selection text xyzr
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
echo "# libFuzzer, address and undefined-behaviour sanitizers; tests/fuzz/record.sh"
echo "harness,seconds,inputs,edges,features,corpus,finding"
for name; do
    corpus=${FUZZ_CORPUS:-$work}/$name
    mkdir -p "$corpus"
    FUZZ_CORPUS=$corpus FUZZ_RECORD=$work/record nice -n 19 \
        sh "$here/run.sh" "$name" "$seconds" "$programs/fuzz_$name" >&2 || true
done
cat "$work/record"
