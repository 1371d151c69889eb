# Runs one case: sh run.sh CASE.sh OVOID CHECK_REPORT CHECK_MEASURES. The case runs in an empty folder of its own.
# Exit code 77 means skipped. Cases use the functions below; the first failed expectation ends them.
case_file=$1
OVOID=$2
CHECK_REPORT=$3
CHECK_MEASURES=$4
here=$(cd "$(dirname "$0")" && pwd)
place=$(mktemp -d "${TMPDIR:-/tmp}/ovoid-cli-XXXXXX") || exit 1
export OVOID_SELFTEST="${OVOID_SELFTEST-off}" # by itself it is selftest.sh's
out=$place/out
err=$place/err
mkdir "$place/work" && cd "$place/work" || exit 1
pid= # of a process in the background, see finish()
trap '[ -z "$pid" ] || kill -s KILL $pid; chmod -R u+w "$place"; rm -rf "$place"' EXIT
trap 'exit 1' INT TERM HUP

fail() {
    echo "FAILED: $*"
    echo "--- last command: $last"
    echo "--- exit code: $code"
    echo "--- standard output:" && head -n 40 "$out"
    echo "--- standard error:" && head -n 40 "$err"
    exit 1
}

# run COMMAND...: leaves its exit code in $code and its output in $out and $err.
run() {
    last=$*
    "$@" >"$out" 2>"$err" </dev/null
    code=$?
}

expect_code() { [ "$code" -eq "$1" ] || fail "exit code $1 was expected"; }
expect_err() { grep -qF -- "$1" "$err" || fail "standard error should say: $1"; }
expect_out() { grep -qF -- "$1" "$out" || fail "standard output should say: $1"; }
expect_silent() { [ ! -s "$err" ] || fail "standard error should be empty"; }
expect_no_out() { [ ! -s "$out" ] || fail "standard output should be empty"; }

# The folder holds these names and nothing else, hidden or not.
expect_files() {
    wanted=$(printf '%s\n' "$@" | sort)
    [ $# -gt 0 ] || wanted=
    found=$(ls -A | sort)
    [ "$found" = "$wanted" ] || fail "files '$wanted' were expected, but there are '$found'"
}

# Waits until process $pid has written to a file that still has another name.
await_writing() {
    until [ -n "$(find . -name '.ovoid-*.tmp' -size +0)" ]; do
        kill -0 $pid 2>/dev/null || fail "the program ended before it wrote anything"
        sleep 0.05
    done
}

# Waits for the end of process $pid: leaves its exit code in $code.
finish() {
    wait $pid
    code=$?
    pid=
}

skip() {
    echo "SKIPPED: $*"
    exit 77
}

need_device() { "$OVOID" devices >"$out" 2>&1 || skip "no OpenCL device"; }

# make_helix ATOMS FILE: an XYZR file of atoms along a helix.
make_helix() {
    awk -v n="$1" 'BEGIN { for (i = 0; i < n; i++)
        printf "%.4f %.4f %.4f %.2f\n", 3 * cos(i), 3 * sin(i), 0.8 * i, 1.4 + 0.1 * (i % 4) }' \
        >"$2"
}

# make_chain ATOMS FILE: the same of a tighter helix, with atoms as near as bonded ones: they merge
# well.
make_chain() {
    awk -v n="$1" 'BEGIN { for (i = 0; i < n; i++)
        printf "%.4f %.4f %.4f %.2f\n", 1.5 * cos(i), 1.5 * sin(i), 0.5 * i, 1.4 + 0.1 * (i % 4) }' \
        >"$2"
}

# rows FILE: lines that do not begin with '#'.
rows() { grep -cv '^#' "$1"; }

code=0
last=
: >"$out"
: >"$err"
. "$case_file"
