# Several ranks of MPI: the file of one process, said and written once, whatever becomes of a rank.
"$OVOID" --version | grep -q '^with MPI$' || skip "the tool was built without MPI"
command -v mpirun >/dev/null || skip "no mpirun"
need_device
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_hwloc_base_binding_policy=none
export OMPI_MCA_btl_vader_single_copy_mechanism=none # containers forbid it
unset OVOID_DEVICE
ranks() { # N COMMAND...
    number=$1
    shift
    run timeout 300 mpirun -n "$number" "$OVOID" "$@"
}
once() { [ "$(grep -cF -- "$1" "$2")" -eq 1 ] || fail "it should say once: $1"; }
make_chain 1600 a.xyzr
parts="--ratio 0.05 --part-atoms 64 --no-measure"
loose="--tolerance 0.4 --spacing 0.7"

run "$OVOID" fit a.xyzr -o one.ovoid $parts
expect_code 0
for n in 1 2 4; do
    ranks $n fit a.xyzr -o ranks.ovoid $parts
    expect_code 0
    expect_silent
    once "32 parts" "$out"
    [ $n = 1 ] || once ", $n ranks" "$out"
    [ $n = 1 ] || once "work      $n workers of $n ranks: busy " "$out"
    cmp -s one.ovoid ranks.ovoid || fail "$n ranks should make the model that one process makes"
    rm ranks.ovoid
done
make_chain 130 b.xyzr # within a tolerance, in levels, by several workers; measured at the end
run "$OVOID" fit b.xyzr -o b.ovoid --part-atoms 64 $loose --levels 2 -q
expect_code 0
ranks 2 fit b.xyzr -o c.ovoid --part-atoms 64 $loose --levels 2 --jobs 2 --report r.json --profile
expect_code 0
once "work      4 workers of 2 ranks: busy " "$out"
once "rank              workers" "$out"
[ "$(grep -c '"share_waiting"' r.json)" -eq 2 ] || fail "both ranks should be in the report"
[ "$(grep -c '"kind":.*"fit"' r.json)" -eq 4 ] || fail "all parts should be in the report, as tasks"
grep -q '^field  *[1-9]' "$out" || fail "kernels of a rank's workers should be counted"
cmp -s b.ovoid c.ovoid || fail "two ranks should make the model that one process makes"
cmp -s b.level2.ovoid c.level2.ovoid || fail "the second level should be the same, too"
rm [bc].*ovoid r.json

# A symmetric assembly: by its unit, as one process does, and all atoms where that is asked for.
awk 'BEGIN { print "REMARK 350 BIOMOLECULE: 1\nREMARK 350 APPLY THE FOLLOWING TO CHAINS: A"
    for (p = 1; p <= 2; p++) for (k = 1; k <= 3; k++)
        printf "REMARK 350   BIOMT%d %3d %9.6f %9.6f %9.6f %14.5f\n", k, p, k == 1 ? 3 - 2 * p : 0, k == 2 ? 3 - 2 * p : 0, k == 3, 0
    for (i = 1; i <= 160; i++)
        printf "ATOM  %5d  C   ALA A %3d    %8.3f %8.3f %8.3f %6.3f %6.3f\n", i, i / 8 + 1, 4 + 1.5 * cos(i), 1.5 * sin(i), 0.5 * i, 0, 1.5 }' >s.pqr
symmetric="s.pqr --assembly 1 --ratio 0.1 --part-atoms 64 --no-measure"
run "$OVOID" fit $symmetric -o s1.ovoid
expect_code 0
expect_out "4 parts, one of 2 units"
ranks 3 fit $symmetric -o s3.ovoid
expect_code 0
expect_silent
once "4 parts, one of 2 units, 3 ranks" "$out"
cmp -s s1.ovoid s3.ovoid || fail "three ranks should make the model of the unit that one process makes"
run "$OVOID" fit $symmetric -o s1.ovoid --no-symmetry -q
expect_code 0
ranks 2 fit $symmetric -o s3.ovoid --no-symmetry -q
expect_code 0
cmp -s s1.ovoid s3.ovoid || fail "two ranks should make the model of all atoms that one process makes"
ranks 2 fit s.pqr --assembly 1 --ratio 0.1 --part-atoms 200 -o s3.ovoid --no-measure
expect_code 0
once "1 part cannot keep 2 ranks busy" "$err"
rm s.pqr s1.ovoid s3.ovoid

# Devices that come to other bits, here by other shapes of kernels: the same model whoever is faster, and a warning.
for name in u1 u2; do
    run timeout 300 mpirun -n 1 "$OVOID" fit a.xyzr $parts -o $name.ovoid : \
        -n 1 -x OVOID_SHAPE=4x1 "$OVOID" fit a.xyzr $parts -o $name.ovoid
    expect_code 0
    once "the ranks have different devices or drivers" "$err"
done
cmp -s u1.ovoid u2.ovoid || fail "ranks of different devices should make the same model again"
cmp -s one.ovoid u1.ovoid && fail "other shapes were to come to other bits"
rm u1.ovoid u2.ovoid

# What cannot be shared rank 0 does alone.
ranks 3 fit b.xyzr $loose --no-measure
expect_code 0
once "rank 0 of 3 works alone" "$err"
once "--part-atoms" "$err"
once "written to b.ovoid" "$out"
ranks 3 fit b.xyzr --method l1 --iterations 10 -o d.ovoid --no-measure
expect_code 0
once "method l1 has no parts" "$err"
ranks 2 measure b.xyzr b.ovoid
expect_code 0
once "Hausdorff" "$out"
rm b.ovoid d.ovoid

# Failures are told once, whoever's they are.
ranks 3 fit nothing.xyzr
expect_code 3
once "nothing.xyzr" "$err"
ranks 2 fit a.xyzr --part-atoms 10
expect_code 2
once "parts.atoms" "$err"
ranks 2 fit a.xyzr $parts --device 0,nothing
expect_code 5
once "ovoid: error: rank 1: " "$err"
expect_err "nothing"
ranks 3 fit a.xyzr $parts --checkpoint nowhere/c
expect_code 4
once "rank 0: nowhere/c" "$err"
ranks 2 fit a.xyzr --part-atoms 64 --no-measure --time-limit 0.001
expect_code 10
once "no model held" "$err"
expect_files a.xyzr b.xyzr one.ovoid

# A rank is killed when there is another part on file, once each; then the others go on for them.
size_of() { wc -c <"$1" 2>/dev/null || echo 0; }
process_of() { # RANK, of the mpirun $pid
    for child in $(cat /proc/$pid/task/*/children 2>/dev/null); do
        tr '\0' '\n' <"/proc/$child/environ" 2>/dev/null | grep -qx "OMPI_COMM_WORLD_RANK=$1" && echo "$child"
    done
}
last="mpirun -n 3 ovoid fit with a checkpoint, one rank killed after the other"
size=0
for victim in 0 1 2; do
    mpirun -n 3 "$OVOID" fit a.xyzr -o two.ovoid $parts -q --checkpoint c --resume >"$out" 2>"$err" </dev/null &
    pid=$!
    while [ "$(size_of c)" -le "$size" ] && kill -0 $pid 2>/dev/null; do sleep 0.01; done
    kill -s KILL $(process_of $victim) || fail "rank $victim had ended before it could be killed"
    finish
    [ "$code" -ne 0 ] || fail "mpirun should tell that a rank has died"
    [ ! -e two.ovoid ] || fail "there should be no model after a kill"
    size=$(size_of c)
done
ranks 2 fit a.xyzr -o two.ovoid $parts -q --checkpoint c --resume
expect_code 0
cmp -s one.ovoid two.ovoid || fail "ranks that were killed should come to the same model"
expect_files a.xyzr b.xyzr one.ovoid two.ovoid
