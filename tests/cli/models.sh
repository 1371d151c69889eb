# Every model of a file in one run: --models all.
need_device
goal="--ellipsoids 6 --spacing 0.7" # few points: nothing depends on how good it is

# make_models FILE NUMBER[+]...: a PDB file of a chain of $size atoms, in each model a little longer; with a
# + an atom more, with a - five atoms alone.
make_models() {
    file=$1
    shift
    for number; do
        atoms=$size
        case $number in *+) atoms=$((size + 1)) ;; *-) atoms=5 ;; esac
        awk -v n=$atoms -v m="${number%[+-]}" 'BEGIN {
            printf "MODEL     %4d\n", m
            for (i = 0; i < n; i++)
                printf "ATOM  %5d  CA  ALA A%4d    %8.3f%8.3f%8.3f  1.00 20.00           C\n", i + 1, i + 1,
                    1.5 * cos(i + 0.02 * m * sin(i)), 1.5 * sin(i + 0.02 * m * sin(i)), 0.5 * i * (1 + 0.01 * m)
            print "ENDMDL" }'
    done >"$file"
}
size=30
make_models e.pdb 1 2 3 7
run "$OVOID" fit e.pdb --model 1 $goal -o ../single.ovoid --report ../single.json
expect_code 0
run "$OVOID" fit e.pdb --model 2 $goal -o ../second.ovoid
expect_code 0

# The first begins with its atoms, as alone; each of the others with the one before.
run "$OVOID" fit e.pdb --models all $goal -o m.v1.ovoid --levels 2 --report r.jsonl --owners o.csv --trace t.csv
expect_code 0
expect_silent
expect_files e.pdb r.jsonl $(for n in 1 2 3 7; do
    echo m.v1.model$n.ovoid m.v1.model$n.level2.ovoid o.model$n.csv o.model$n.level2.csv t.model$n.csv
done)
number='  *[0-9.e+-]*'
for n in 1 2 3 7; do
    grep -q "^ *$n  *30  *6$number$number$number$number  done\$" "$out" || fail "a row of model $n was expected"
    [ "$(rows m.v1.model$n.level2.ovoid)" -eq 3 ] || fail "model $n should have its second level"
    [ "$(wc -l <o.model$n.csv)" -eq 31 ] || fail "model $n should have its owners"
    [ "$(cut -d , -f 1 t.model$n.csv | sort -u | tr '\n' ' ')" = "1 2 level " ] ||
        fail "the trace of model $n should hold its levels"
done
expect_out "4 of 4 models of e.pdb fitted, written to m.v1.modelN.ovoid"
grep -q '^# model: 1$' m.v1.model1.ovoid || fail "the model should say which one it is"
grep -q '^# model: 7, moved on from model 3$' m.v1.model7.ovoid || fail "the model should say what it began with"
grep -v '^#' m.v1.model1.ovoid >../a && grep -v '^#' ../single.ovoid | cmp -s - ../a ||
    fail "the first model should be that of a single run"
[ "$(sed 's/.*"model":\([0-9]*\).*"moved_from":\([0-9a-z]*\).*/\1<\2/' r.jsonl | tr '\n' ' ')" = "1<null 2<1 3<2 7<3 " ] ||
    fail "the report should tell what each began with"

# From model to model an ellipsoid stays itself: it moves no further than the atoms do, 2 % of 15 Å for
# one number more.
paste m.v1.model1.ovoid m.v1.model2.ovoid | grep -v '^#' | awk '{
    d = sqrt(($5 - $15) ^ 2 + ($6 - $16) ^ 2 + ($7 - $17) ^ 2); if (d > most) most = d }
    END { exit !(NR == 6 && most > 0.01 && most < 0.5) }' || fail "ellipsoids should keep their place"
grep -v '^#' ../second.ovoid >../a
grep -v '^#' m.v1.model2.ovoid | cmp -s - ../a && fail "the second should not begin with its atoms"
rm m.* o.* t.* r.jsonl

# With more levels, too, the next one begins with the goal's model, not with the last level's.
run "$OVOID" fit e.pdb --models all $goal --out-dir d --owners o.csv --no-measure --quiet
expect_code 0
expect_no_out
run "$OVOID" fit e.pdb --models all $goal --out-dir d2 --levels 3 --quiet
expect_code 0
(cd d && expect_files $(for n in 1 2 3 7; do echo e.model$n.ovoid e.model$n.o.csv; done)) || exit 1
cat d/*.ovoid | grep -v '^#' >../a
cat d2/e.model?.ovoid | grep -v '^#' | cmp -s - ../a || fail "levels should not change the goal's models"
rm -r d d2

# Files of one model, and mmCIF, whose atoms alternate.
run "$OVOID" fit e.pdb --models all --method l1 --iterations 20 --select '*' -o m -q
expect_code 0
expect_files e.pdb m.model1 m.model2 m.model3 m.model7
rm m.*
awk 'BEGIN { print "data_x\nloop_\n_atom_site.type_symbol\n_atom_site.Cartn_x\n_atom_site.Cartn_y\n_atom_site.Cartn_z\n_atom_site.pdbx_PDB_model_num"
    for (i = 0; i < 12; i++) for (m = 4; m < 6; m++) print "C", 1.2 * i, m, 0.9 * i + 0.01 * m * (i % 2), m }' >x.cif
run "$OVOID" fit x.cif --models all --ellipsoids 2
expect_code 0
expect_silent
expect_files e.pdb x.cif x.model4.ovoid x.model5.ovoid
run "$OVOID" fit x.cif --ellipsoids 2 --no-measure
expect_out "12 atoms, model 4 of 2,"
rm x.*
grep ^ATOM e.pdb | head -n 30 >plain.pdb
run "$OVOID" fit plain.pdb --models all $goal -o one.ovoid
expect_code 0
expect_out "1 of 1 model of plain.pdb fitted"
rm plain.pdb one.model1.ovoid

# Other atoms: from these, and a warning that says so.
make_models o.pdb 1 2+ 3
run "$OVOID" fit o.pdb --models all $goal
expect_code 0
expect_err "ovoid: warning: o.pdb, model 2: its atoms or their radii are not those of model 1"
expect_err "ovoid: warning: o.pdb, model 3: its atoms or their radii are not those of model 2"
run "$OVOID" fit o.pdb --models all $goal -o q.ovoid -q
expect_silent
grep -q '^# model: 3$' q.model3.ovoid || fail "model 3 should begin with its atoms"
rm o.* q.*

# In parts each begins with its atoms, as alone.
size=150
make_models w.pdb 1 2
size=30
run "$OVOID" fit w.pdb --models all --ratio 0.2 --part-atoms 64 --report r.jsonl -o w.ovoid --no-measure
expect_code 0
expect_silent
[ "$(grep -c '"moved_from":null' r.jsonl)" -eq 2 ] || fail "both should begin with their atoms"
run "$OVOID" fit w.pdb --model 2 --ratio 0.2 --part-atoms 64 -o alone.ovoid --no-measure -q
expect_code 0
grep -v '^#' alone.ovoid >../a
grep -v '^#' w.model2.ovoid | cmp -s - ../a || fail "the second should be that of a single run"
rm w.* alone.ovoid r.jsonl

# One that fails does not stop the others.
make_models few.pdb 1 2- 3
run "$OVOID" fit few.pdb --models all $goal --report r.jsonl
expect_code 8
expect_err "ovoid: error: few.pdb, model 2: --ellipsoids is 6, but few.pdb has only 5 atoms"
expect_out "2 of 3 models of few.pdb fitted, written to few.modelN.ovoid; 1 failed"
expect_files e.pdb few.pdb few.model1.ovoid few.model3.ovoid r.jsonl
grep -q '"model":2,"status":"failed","exit_code":2' r.jsonl || fail "the report should tell of model 2"
grep -q '^# model: 3, moved on from model 1$' few.model3.ovoid || fail "model 3 should go on from model 1"
rm few.* r.jsonl

# What cannot be, before any work.
refused() {
    wanted=$1
    shift
    run "$OVOID" fit "$@"
    expect_code "$wanted"
    expect_no_out
    expect_files e.pdb
}
refused 2 e.pdb --models 3
expect_err "--models takes all, not '3'"
refused 2 e.pdb e.pdb --models all
expect_err "there are 2 files"
refused 2 - --models all
expect_err "standard input cannot be"
refused 2 e.pdb --models all --model 2
expect_err "leave one of the two out"
refused 2 e.pdb --models all --checkpoint c
expect_err "--checkpoint does not go with --models"
for option in -o --owners --trace; do
    refused 2 e.pdb --models all $option -
    expect_err "standard output cannot take"
done
refused 2 e.pdb --models all -o m.ovoid --owners m.ovoid
expect_err "two of the files that come of 'e.pdb' would be 'm.model1.ovoid'"
refused 2 e.pdb --models all -o m.ovoid --report m.model7.ovoid
expect_err "are the same file"
refused 2 e.pdb --models all -o m.ovoid --out-dir d
expect_err "-o names the file of one model"
refused 3 none.pdb --models all
expect_err "none.pdb"
make_models ../twice.pdb 1 2 2
refused 3 ../twice.pdb --models all
expect_err "../twice.pdb: 3 models share 2 numbers"
make_helix 5 ../a.xyzr
refused 3 ../a.xyzr --models all
expect_err "an XYZR file has no models"
printf 'MODEL 1\nENDMDL\n' >../empty.pdb
refused 3 ../empty.pdb --models all
make_models ../zero.pdb 0 1
refused 3 ../zero.pdb --models all
expect_err "a model has the number 0"

# A model whose file cannot be written is one that failed.
mkdir m.model2.ovoid
run "$OVOID" fit e.pdb --models all $goal -o m.ovoid
expect_code 8
expect_err "m.model2.ovoid"
expect_files e.pdb m.model1.ovoid m.model2.ovoid m.model3.ovoid m.model7.ovoid
rm -r m.*

# A signal: what is finished stays, and is told; a trace that nobody reads holds the second model.
env --default-signal=INT true 2>/dev/null || skip "env cannot reset signals"
mkfifo t.model2.csv
last="ovoid fit e.pdb --models all, SIGINT in the second"
env --default-signal=INT "$OVOID" fit e.pdb --models all $goal -o m.ovoid --trace t.csv --report r.jsonl \
    >"$out" 2>"$err" &
pid=$!
until [ -e t.model1.csv ] && [ -e m.model1.ovoid ]; do
    kill -0 $pid || fail "the program should wait"
    sleep 0.05
done
kill -s INT $pid
finish
expect_code 130
[ "$(grep -c interrupted "$err")" -eq 1 ] || fail "one message was expected"
expect_files e.pdb m.model1.ovoid r.jsonl t.model1.csv t.model2.csv
expect_out "1 of 4 models of e.pdb fitted, written to m.modelN.ovoid; 3 left out"
[ "$(wc -l <r.jsonl)" -eq 1 ] || fail "the report should tell what was done"
