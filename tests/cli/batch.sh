# Several molecules in one run.
need_device
goal="--ellipsoids 4"
make_chain 20 a.xyzr
make_helix 12 ../b.v1.xyzr && gzip -c ../b.v1.xyzr >b.v1.xyzr.gz
make_chain 9 ../c.xyzr
awk '{ printf "ATOM %d C ALA %d %s 0.0 %s\n", NR, NR, $1 " " $2 " " $3, $4 }' ../c.xyzr >c.pqr
for file in a.xyzr b.v1.xyzr.gz c.pqr; do
    run "$OVOID" fit $file $goal -q
    expect_code 0
done
mkdir ../single && mv ./*.ovoid ../single

# All of them: the models are what single runs write, on a device that has seen other molecules.
run "$OVOID" fit a.xyzr b.v1.xyzr.gz c.pqr $goal --out-dir d --report r.jsonl --owners o.csv \
    --trace steps
expect_code 0
expect_silent
expect_files a.xyzr b.v1.xyzr.gz c.pqr d r.jsonl
(cd d && expect_files a.ovoid b.v1.ovoid c.ovoid a.o.csv b.v1.o.csv c.o.csv a.steps b.v1.steps \
    c.steps) || exit 1
for name in a b.v1 c; do
    cmp -s d/$name.ovoid ../single/$name.ovoid || fail "$name.ovoid should be that of a single run"
done
number='[ ]*[0-9.e+-]*'
for row in "a.xyzr  *20  *4$number$number$number  *[0-9.]*  done" \
    "b.v1.xyzr.gz  *12  *4$number$number$number  *[0-9.]*  done" \
    "c.pqr  *9  *4$number$number$number  *[0-9.]*  done"; do
    grep -q "^$row\$" "$out" || fail "a row '$row' was expected"
done
expect_out "3 of 3 molecules fitted, models in d"
[ "$(wc -l <d/a.o.csv)" -eq 21 ] || fail "a row for each atom was expected"
head -n 1 d/c.steps | grep -q '^level,step,' || fail "a trace was expected"
[ "$(wc -l <r.jsonl)" -eq 3 ] || fail "a line for each molecule was expected"
grep -q '"status":"done","exit_code":0}$' r.jsonl || fail "the report should give the status"
# Each line is the report of its run.
for line in 1:a:20 2:b.v1:12 3:c:9; do
    name=${line#*:} && atoms=${name#*:} && name=${name%:*}
    sed -n "${line%%:*}p" r.jsonl >../line.json
    run "$CHECK_REPORT" ../line.json d/$name.ovoid d/$name.steps atoms="$atoms" ellipsoids=4
    expect_code 0
done
rm -r d r.jsonl

# Some fail, and the others do not care. One of the reasons is the goal: it has too few atoms.
echo "ATOM 1 C ALA 1 x 0 0 0 1" >bad.pqr
head -n 3 a.xyzr >few.xyzr
: >empty.xyzr
run "$OVOID" fit bad.pqr a.xyzr none.pqr few.xyzr empty.xyzr c.pqr $goal --report r.jsonl
expect_code 8
expect_files a.xyzr b.v1.xyzr.gz c.pqr bad.pqr few.xyzr empty.xyzr a.ovoid c.ovoid r.jsonl
expect_err "ovoid: error: bad.pqr:1:"
expect_err "ovoid: error: none.pqr: cannot open"
expect_err "ovoid: error: --ellipsoids is 4, but few.xyzr has only 3 atoms"
expect_err "ovoid: error: empty.xyzr"
grep -q '^few.xyzr  *3  *-  *-  *-  *-  *[0-9.]*  failed (2)$' "$out" || fail "a failed row was expected"
expect_out "2 of 6 molecules fitted, models in .; 4 failed"
grep -q '"input":"none.pqr","status":"failed","exit_code":3,"error":".*none.pqr.*No such file.*"}$' \
    r.jsonl || fail "the report should say why"
cut -d '"' -f 8 r.jsonl | tr '\n' ' ' | grep -q '^bad.pqr a.xyzr none.pqr few.xyzr empty.xyzr c.pqr $' ||
    fail "the report should have the molecules in their order"
rm ./*.ovoid r.jsonl

# None: the common reason, or that there is none.
run "$OVOID" fit bad.pqr none.pqr $goal -q
expect_code 3
expect_no_out
run "$OVOID" fit bad.pqr few.xyzr $goal
expect_code 9
expect_out "0 of 2 molecules fitted"

# A goal that was not reached is no failure; the warning names the molecule.
run "$OVOID" fit a.xyzr c.pqr --tolerance 0.2 --steps 0 -q --out-dir d
expect_code 7
expect_no_out
expect_err "ovoid: warning: a.xyzr: the goal was not reached"
(cd d && expect_files a.ovoid c.ovoid) || exit 1
run "$OVOID" fit a.xyzr none.pqr --tolerance 0.2 --steps 0 --out-dir d
expect_code 8
expect_out "goal not reached"
rm -r d

# A single one with --out-dir is done the same way. The report may go to standard output.
run "$OVOID" fit a.xyzr $goal --out-dir d/ --report -
expect_code 0
[ "$(wc -l <"$out")" -eq 1 ] || fail "the report alone should be on standard output"
grep -q '"output":"d/a.ovoid"' "$out" || fail "the report should name the model"
expect_err "1 of 1 molecule fitted"
run "$OVOID" fit a.xyzr c.pqr $goal --out-dir d --profile
expect_code 0
grep -q '^all fits  *[0-9]' "$out" || fail "the profile of all fits was expected"
rm -r d

# Names that would meet, before anything is written.
clash() {
    run "$OVOID" fit "$@"
    expect_code 2
    expect_no_out
}
mkdir sub && cp c.pqr sub/a.pqr && cp c.pqr a.level2.pqr && cp c.pqr e.ovoid
clash a.xyzr sub/a.pqr $goal
expect_err "'a.xyzr' and 'sub/a.pqr' would both be written to './a.ovoid'"
clash a.xyzr a.xyzr
expect_err "'a.xyzr' is named twice"
clash a.xyzr a.level2.pqr $goal --levels 2 --out-dir d
expect_err "would both be written to 'd/a.level2.ovoid'"
clash a.xyzr e.ovoid --format pqr
expect_err "what comes of 'e.ovoid' would be written over the molecule 'e.ovoid'"
clash a.xyzr c.pqr --report ./c.ovoid
expect_err "the report (--report) and what comes of 'c.pqr' are the same file"
clash a.xyzr c.pqr --report sub/../a.xyzr
expect_err "the report (--report) and a molecule are the same file 'a.xyzr'"
[ ! -e d ] || fail "there should be no folder yet"

# Folders and devices that are not there.
run "$OVOID" fit a.xyzr c.pqr --out-dir no/d
expect_code 4
expect_err "cannot make the folder 'no/d': No such file or directory"
run "$OVOID" fit a.xyzr c.pqr --out-dir c.pqr
expect_code 4
expect_err "cannot make the folder 'c.pqr'"
run "$OVOID" fit a.xyzr c.pqr --report no/r.jsonl
expect_code 4
run "$OVOID" fit a.xyzr c.pqr --device nonesuch
expect_code 5
rm -r sub a.level2.pqr e.ovoid bad.pqr few.xyzr empty.xyzr
expect_files a.xyzr b.v1.xyzr.gz c.pqr

# A progress line counts.
if script -qec true /dev/null >/dev/null 2>&1; then
    make_chain 100 a-molecule-with-a-long-name.xyzr
    TERM=xterm script -qec "stty cols 90; '$OVOID' fit c.pqr a-molecule-with-a-long-name.xyzr \
        --ratio 0.3 --levels 2 --out-dir d" /dev/null >"$out" </dev/null
    tr '\r' '\n' <"$out" >../lines
    grep -q '^2/2 a-molecule-with-a-lo  level 1/2  [a-z]*  ' ../lines ||
        fail "a progress line that counts was expected"
    rm -r d a-molecule-with-a-long-name.xyzr
fi

# A signal stops all: what is done stays, and is told.
env --default-signal=INT true 2>/dev/null || skip "env cannot reset signals"
make_helix 3000 big.xyzr
last="ovoid fit c.pqr big.xyzr a.xyzr, then SIGINT"
env --default-signal=INT "$OVOID" fit c.pqr big.xyzr a.xyzr --ratio 0.3 --effort 10 --out-dir d \
    --report r.jsonl >"$out" 2>"$err" &
pid=$!
tries=0
until [ -e d/c.ovoid ]; do
    tries=$((tries + 1))
    [ $tries -lt 600 ] && kill -0 $pid || fail "the first fit did not end"
    sleep 0.05
done
sleep 0.5
kill -s INT $pid
(sleep 30 && kill -s KILL $pid) >/dev/null 2>&1 &
watchdog=$!
wait $pid
code=$?
kill $watchdog
expect_code 130
[ "$(grep -c interrupted "$err")" -eq 1 ] || fail "one message was expected"
expect_out "1 of 3 molecules fitted, models in d; 2 left out"
(cd d && expect_files c.ovoid) || exit 1
[ "$(wc -l <r.jsonl)" -eq 1 ] || fail "the report should tell what was done"
