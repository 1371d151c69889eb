#!/bin/sh
# run.sh NAME SECONDS PROGRAM: runs the harness NAME for so long, from its seeds and a fixed random
# seed (another one: FUZZ_SEED), and says how to repeat what it finds. 77: there is no libFuzzer.
#
# An input of at most 64 KiB may take 10 seconds (of the processor's time: fuzz.c) and 1 GiB,
# sanitizers included: what takes more is a finding, as is any error that a sanitizer sees. New inputs are kept in the folder FUZZ_CORPUS,
# if one is named, findings in FUZZ_FINDINGS (default: fuzz-findings in the current folder). A line
# about the run is appended to the file FUZZ_RECORD (record.sh).
set -u
name=$1
seconds=$2
program=$3
here=$(cd "$(dirname "$0")" && pwd)
if [ -z "$program" ]; then
    echo "skipped: this compiler has no libFuzzer (of Debian 12: clang with libclang-rt-dev)"
    exit 77
fi
findings=${FUZZ_FINDINGS:-fuzz-findings}/$name
mkdir -p "$findings"
dictionary=$here/dictionaries/$name.dict
[ -e "$dictionary" ] || dictionary=
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
log=$work/log
mkdir "$work/corpus"

# The number behind a word of the last line about progress.
after() {
    echo "$progress" | sed -n "s/.* $1: \([0-9]*\).*/\1/p"
}
record() {
    [ -z "${FUZZ_RECORD:-}" ] ||
        echo "$name,$seconds,${executions:-},$(after cov),$(after ft),$(after corp),$1" >>"$FUZZ_RECORD"
}

status=0
"$program" -seed="${FUZZ_SEED:-1}" -max_total_time="$seconds" -max_len=65536 -timeout=300 \
    -rss_limit_mb=1024 -print_final_stats=1 -artifact_prefix="$findings/" \
    ${dictionary:+-dict="$dictionary"} "${FUZZ_CORPUS:-$work/corpus}" "$here/seeds/$name" \
    >"$log" 2>&1 || status=$?
progress=$(grep -a '^#[0-9]*[[:space:]].* cov: ' "$log" | tail -n 1) # "#123 DONE cov: 45 ft: 67 corp: 8/9b"
executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
if [ "$status" -ne 0 ]; then
    tail -n 60 "$log"
    record "$(sed -n 's/^SUMMARY: //p' "$log" | tail -n 1 | tr ',' ';')"
    input=$(sed -n 's/.*Test unit written to *//p' "$log" | tail -n 1)
    echo
    echo "$name: a finding after ${executions:-some} inputs. Again, with that input alone:"
    echo "  $program -timeout=300 -rss_limit_mb=1024 ${input:-$here/seeds/$name/*}"
    [ ! -f "$input" ] || { echo "It is, in base64:"; head -c 6000 "$input" | base64; }
    exit 1
fi
if [ "${executions:-0}" -eq 0 ]; then
    tail -n 20 "$log"
    echo "$name: nothing was executed"
    exit 1
fi
record none
echo "$name: $executions inputs in $seconds s, no finding; edges $(after cov), features $(after ft)"
