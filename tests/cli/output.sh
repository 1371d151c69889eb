# Where the model goes, and that nothing is left of it when it cannot go there.
need_device
make_helix 6 a.xyzr
few="--method l1 --iterations 5"

# By default into the current folder, under the molecule's name.
mkdir sub
gzip -c a.xyzr >sub/mol.v1.xyzr.gz
run "$OVOID" fit sub/mol.v1.xyzr.gz $few
expect_code 0
expect_silent
expect_out "written to mol.v1.ovoid"
expect_files a.xyzr sub mol.v1.ovoid
[ "$(head -n 1 mol.v1.ovoid)" = "# ovoid model 1" ] || fail "the model has no first line"
for note in "program: ovoid " "input: sub/mol.v1.xyzr.gz" "device: " "settings: method l1" "decay: 0.5"; do
    grep -qF "# $note" mol.v1.ovoid || fail "the model should have a header line '$note'"
done

# To standard output, the summary apart.
run "$OVOID" fit a.xyzr $few -o -
expect_code 0
[ "$(head -n 1 "$out")" = "# ovoid model 1" ] || fail "the model should be on standard output"
grep -qvE '^(#|[-0-9])' "$out" && fail "nothing but the model should be on standard output"
expect_err "molecule  a.xyzr: 6 atoms"
expect_err "written to standard output"
run "$OVOID" fit a.xyzr $few --quiet -o -
expect_code 0
expect_silent

# Quiet is quiet.
run "$OVOID" fit a.xyzr $few -q
expect_code 0
expect_silent
expect_no_out

# Over what is there, through a link, with its permissions.
echo old >real.ovoid
chmod 604 real.ovoid
ln -s real.ovoid link.ovoid
run "$OVOID" fit a.xyzr $few -o link.ovoid
expect_code 0
[ -L link.ovoid ] || fail "the link should still be one"
[ "$(ls -l real.ovoid | cut -c 1-10)" = "-rw----r--" ] || fail "the permissions should stay"
head -n 1 real.ovoid | grep -q "ovoid model" || fail "the link's target should hold the model"
rm -r ./*.ovoid sub

# Refused before the work, which would begin with a line of output.
cannot() {
    text=$1
    shift
    run "$OVOID" fit a.xyzr $few "$@"
    expect_code 4
    expect_no_out
    expect_err "ovoid: error: cannot write"
    expect_err "$text"
    expect_files a.xyzr
}
cannot "there is no folder 'no'" -o no/a.ovoid
cannot "there is no folder 'no'" --report no/r.json
cannot "there is no folder 'no'" --trace no/t.csv
cannot "Is a directory" -o .
cannot "'a.xyzr/x'" -o a.xyzr/x
if [ "$(id -u)" -ne 0 ]; then
    mkdir ../locked && chmod 555 ../locked
    cannot "Permission denied" -o ../locked/a.ovoid
elif [ -d /sys/kernel ]; then
    cannot "/sys/kernel" -o /sys/kernel/a.ovoid
fi

# A full disk.
echo old >a.ovoid
if [ -w /dev/full ]; then
    run "$OVOID" fit a.xyzr $few -o /dev/full
    expect_code 4
    expect_err "cannot write '/dev/full': No space left on device"
    run "$OVOID" fit a.xyzr $few -o - --quiet
    "$OVOID" fit a.xyzr $few -o - >/dev/full 2>"$err"
    code=$?
    expect_code 4
    expect_err "cannot write standard output: No space left on device"
    # A report or a trace that fails does not take the model along.
    for option in --report --trace; do
        rm a.ovoid
        run "$OVOID" fit a.xyzr $few $option /dev/full
        expect_code 4
        expect_err "No space left on device"
        expect_out "model     written to a.ovoid"
        expect_files a.xyzr a.ovoid
    done
fi
# A reader that has gone away: the pipe's only end for reading is closed before.
mkfifo ../pipe
(
    exec 8<>../pipe 9>../pipe 8<&-
    exec "$OVOID" fit a.xyzr $few -o - 2>"$err" >&9
)
code=$?
expect_code 4
expect_err "cannot write standard output: Broken pipe"

# Closed standard output.
"$OVOID" fit a.xyzr $few -q -o - >&- 2>"$err"
code=$?
expect_code 4
expect_err "cannot write standard output"
# Were its number given to the trace, the model would end up there.
"$OVOID" fit a.xyzr $few -q -o - --trace t.csv >&- 2>"$err"
code=$?
expect_code 4
expect_files a.xyzr a.ovoid
