# A search that a time limit ends: nothing is written before a model holds, then the best that held.
need_device
make_chain 90 a.xyzr

# Before anything is done, whatever the goal and the method.
for goal in "--tolerance 0.4" "--ellipsoids 9" "--ratio 0.1 --levels 3" "--method l1"; do
    # shellcheck disable=SC2086 # words of their own
    run "$OVOID" fit a.xyzr $goal --time-limit 1e-9 --report r.json --trace t.csv --owners o.csv
    expect_code 10
    expect_err "no model held within the 1e-09 s of --time-limit"
    expect_files a.xyzr
done

# One that is not needed changes nothing.
run "$OVOID" fit a.xyzr --tolerance 0.4 -o plain.ovoid --no-measure --report plain.json
expect_code 0
run "$OVOID" fit a.xyzr --tolerance 0.4 -o m.ovoid --no-measure --time-limit 1e6 --report r.json
expect_code 0
grep -v '^#' plain.ovoid >plain.rows
grep -v '^#' m.ovoid | cmp -s - plain.rows || fail "a limit that was not met should change nothing"
grep -q '"stopped":[[:space:]]*false' r.json || fail "the report should say that it was not stopped"
grep -q '"time_limit":[[:space:]]*1000000' r.json || fail "the report should hold the limit"
grep -q '"time_limit"' plain.json && fail "a report without a limit should hold none"
grep -q '^# stopped' m.ovoid && fail "the model should not say that it was stopped"
rm m.ovoid r.json

# In between lie limits that end the search when something has held: found by halving, however fast
# the machine is. Each end is one of the three.
low=1e-6
high=1000
for _ in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30; do
    limit=$(echo "$low $high" | awk '{ printf "%.6g", sqrt($1 * $2) }')
    run "$OVOID" fit a.xyzr --tolerance 0.4 --effort 4 -o m.ovoid --time-limit "$limit" \
        --report r.json --trace t.csv
    if [ "$code" -eq 10 ]; then
        low=$limit
        [ ! -e m.ovoid ] && [ ! -e r.json ] || fail "nothing should be written where nothing held"
        continue
    fi
    expect_code 0
    # (What the search knew of the distance when it was stopped is a bound, not what is measured.)
    grep -q '"reached":[[:space:]]*true' r.json || fail "what was written should reach the goal"
    [ "$(rows m.ovoid)" -eq "$(awk '/"ellipsoids"/ { gsub(/[^0-9]/, ""); print; exit }' r.json)" ] ||
        fail "the report should count the ellipsoids"
    [ -s t.csv ] || fail "there should be a trace"
    awk '/"deviation"/ { gsub(/[^0-9.e-]/, ""); exit !($0 + 0 <= 0.4) }' r.json ||
        fail "what was written should hold"
    grep -q '"stopped":[[:space:]]*true' r.json && break
    high=$limit
    rm m.ovoid r.json t.csv
done
grep -q '"stopped":[[:space:]]*true' r.json || fail "no limit ended the search between $low and $high"
grep -q "^# stopped: after the time limit of $limit s\$" m.ovoid || fail "the model should say so"
run "$OVOID" measure a.xyzr m.ovoid --format xyzr
expect_code 0
rm m.ovoid r.json t.csv

# Of several molecules, each has its time.
cp a.xyzr b.xyzr
run "$OVOID" fit a.xyzr b.xyzr --out-dir d --tolerance 0.4 --time-limit 1e-9 --report r.jsonl
expect_code 10
expect_out "0 of 2 molecules fitted"
[ "$(grep -c 'out of time' r.jsonl)" -eq 2 ] || fail "the report should say what became of each"
rm -r d r.jsonl

run "$OVOID" fit a.xyzr --time-limit 0
expect_code 2
expect_err "--time-limit"
