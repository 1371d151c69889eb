# Every help says what it should, on standard output, and succeeds.
for command in "--help" "-h" "help"; do
    run "$OVOID" $command
    expect_code 0
    expect_silent
    for text in "Usage: ovoid COMMAND" "fit " "mesh " "measure " "devices " "Exit codes:" "OVOID_DEVICE" "Examples:"; do
        expect_out "$text"
    done
done

for command in "fit --help" "fit -h" "help fit" "fit molecule.pqr --decay 1 --help"; do
    run "$OVOID" $command
    expect_code 0
    expect_silent
    for text in "Usage: ovoid fit MOLECULE" "Exit codes:" "Examples:" "OVOID_DEVICE" "(default 0.5 Å⁻²)" \
        "(default adaptive)" "(default 0.5 Å)" "(default 0.7 Å, of method l1 1.25 Å)" \
        "  7    a fit did not reach its goal" "B of 20 Å²" "ovoid fit molecule.pqr  "; do
        expect_out "$text"
    done
    for option in output report trace format device method quiet help decay isovalue spacing padding \
        iterations sparse-iterations epsilon max-error prune-below prune-every armijo shrink grow \
        max-backtracks first-step kernel mesh-spacing no-measure tolerance ellipsoids ratio levels effort \
        steps profile; do
        grep -q "^ .*--$option" "$out" || fail "--$option should have an entry"
    done
    awk '{ gsub(/[^ -~]+/, "."); if (length($0) > 100) exit 1 }' "$out" || fail "the help is too wide"
    [ "$(grep -A 1 '^Examples:' "$out" | grep -c '^  ovoid fit molecule.pqr  ')" -eq 1 ] ||
        fail "the plainest example should be the first"
done

for command in "mesh --help" "mesh -h" "help mesh"; do
    run "$OVOID" $command
    expect_code 0
    expect_silent
    for text in "Usage: ovoid mesh INPUT" "Exit codes:" "Examples:" "OVOID_DEVICE" "(default 0.5 Å)" \
        .ply .obj .stl .off .glb; do
        expect_out "$text"
    done
    for option in output format device quiet help spacing isovalue decay vertices; do
        expect_out "--$option"
    done
done

for command in "measure --help" "measure -h" "help measure"; do
    run "$OVOID" $command
    expect_code 0
    expect_silent
    for text in "Usage: ovoid measure MOLECULE MODEL" "Exit codes:" "Examples:" "OVOID_DEVICE"; do
        expect_out "$text"
    done
    for option in report format device quiet help spacing isovalue vertices profile; do
        expect_out "--$option"
    done
done

for command in "devices --help" "devices -h" "help devices"; do
    run "$OVOID" $command
    expect_code 0
    expect_silent
    expect_out "Usage: ovoid devices"
    expect_out "--json"
done

run "$OVOID" --version
expect_code 0
expect_silent
grep -qE '^ovoid [0-9]+\.[0-9]+\.[0-9]+$' "$out" || fail "a version was expected"
! grep -qvE '^(ovoid [0-9.]+|with MPI)$' "$out" || fail "nothing else was expected"

# Without a command the help is an error.
run "$OVOID"
expect_code 2
expect_no_out
expect_err "Usage: ovoid COMMAND"

# Nobody reads a help that could not be written.
if [ -w /dev/full ]; then
    "$OVOID" fit --help >/dev/full 2>"$err"
    code=$?
    expect_code 4
    expect_err "cannot write standard output: No space left on device"
fi
"$OVOID" --version >&- 2>"$err"
code=$?
expect_code 4
expect_err "cannot write standard output"
