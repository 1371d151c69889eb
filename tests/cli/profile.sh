# --profile: a table of kernels that adds up, and the same in the report.
need_device
make_chain 20 a.xyzr

# The rows of the table: name, launches, seconds, share.
table() { sed -n '/^kernel /,$p' "$out" | sed 1d; }
# A sum of the column $1 over the kernels' rows is that of the last row, to within $2.
adds_up() {
    table | awk -v column="$1" -v off="$2" '
        $(column) == "-" { unknown = 1 }
        NR > 1 { sum += last }
        { last = $(column) }
        END { exit !unknown && (NR < 4 || last < 0 || sum - last > off || last - sum > off) }' ||
        fail "column $1 should add up"
}
# Its last rows are these, with the kernels before them.
check_table() {
    [ "$(table | awk '{ print NF }' | sort -u | tail -n 1)" -ge 4 ] || fail "a table was expected"
    table | grep -v '^The device' | awk '{ print $1 }' | tail -n 2 | tr '\n' ' ' |
        grep -q "^all $1 \$" || fail "all else and $1 should end the table"
    # "all else" is two words, and launches nothing.
    table | grep -q '^all else  *-  *' || fail "all else launches nothing"
    sed -i 's/^all else  *-/all_else 0/' "$out"
    sed -i '/^The device/d' "$out"
    adds_up 2 0
    adds_up 3 0.05
    adds_up 4 3
}

run "$OVOID" fit a.xyzr --ellipsoids 5 --steps 10 --profile --report r.json --trace t.csv
expect_code 0
expect_silent
grep -q '^The device took [0-9.]* MB, gave [0-9.]* MB in [1-9][0-9]* blocking reads' "$out" ||
    fail "what passed between host and device was expected"
check_table fit
for kernel in field moments packs_of_terms distances; do
    table | grep -q "^$kernel " || fail "a row of $kernel was expected"
done
# check_report compares with what the fit counted itself.
run "$CHECK_REPORT" r.json a.ovoid t.csv "kernels=$(table | sed '1,/^all_else/!d' | wc -l | awk '{ print $1 - 1 }')"
expect_code 0

# The kernels of all levels, and of the other method.
run "$OVOID" fit a.xyzr --ellipsoids 5 --steps 10 --levels 2 --profile --report r.json --trace t.csv
expect_code 0
check_table fit
run "$CHECK_REPORT" r.json a.ovoid t.csv levels=2
expect_code 0
rm a.level2.ovoid
run "$OVOID" fit a.xyzr --method l1 --iterations 20 --profile --report r.json --trace t.csv
expect_code 0
check_table fit
table | grep -q '^residual ' || fail "a row of residual was expected"
run "$CHECK_REPORT" r.json a.ovoid t.csv
expect_code 0
grep -q '"kernels"' r.json || fail "the report should hold the kernels"

# Profiles change nothing but the time.
"$OVOID" fit a.xyzr --ellipsoids 5 --steps 10 -q -o - >../plain
run "$OVOID" fit a.xyzr --ellipsoids 5 --steps 10 -q --profile -o -
expect_code 0
expect_silent
cmp "$out" ../plain || fail "a profile should not change the model"

# On standard error where standard output is taken; not at all when quiet or not asked.
run "$OVOID" fit a.xyzr --ellipsoids 5 --steps 10 --profile -o -
expect_code 0
expect_err "all else"
grep -q "all else" "$out" && fail "the model's standard output should hold the model alone"
run "$OVOID" fit a.xyzr --ellipsoids 5 --steps 10 --report r.json
expect_code 0
grep -q "all else" "$out" && fail "no table was asked for"
grep -q '"kernels"' r.json && fail "no kernels were asked for"

# Parts: who worked on them, and what workers of their own have launched.
make_chain 200 b.xyzr
run "$OVOID" fit b.xyzr --part-atoms 64 --ratio 0.05 --profile --report r.json --no-measure
expect_code 0
grep '^rank ' -A 1 "$out" | grep -q '^0  *1 ' || fail "a row of the one rank was expected"
grep -q '^work ' "$out" && fail "one worker waits for nobody"
launches=$(awk '/^fit  *[0-9]* .*100.0$/ { print $2 }' "$out")
[ "$launches" -gt 100 ] || fail "kernels were expected"
[ "$(grep -c '"kind":.*"fit"' r.json)" -eq 4 ] || fail "a task for each of four parts was expected"
run "$OVOID" fit b.xyzr --part-atoms 64 --ratio 0.05 --jobs 2 --profile --report r.json --no-measure
expect_code 0
grep -q '^work      2 workers: busy ' "$out" || fail "two workers were expected"
[ "$launches" = "$(awk '/^fit  *[0-9]* .*100.0$/ { print $2 }' "$out")" ] || fail "workers' kernels should be counted"
run "$OVOID" fit b.xyzr --part-atoms 64 --ratio 0.05 --report r.json --no-measure
expect_code 0
grep -q '"tasks":' r.json || fail "what the rank did was expected"
grep -q '"kind"' r.json && fail "no tasks were asked for"
rm b.xyzr b.ovoid

run "$OVOID" measure a.xyzr a.ovoid --isovalue 0.9,1 --profile --report m.json
expect_code 0
expect_silent
check_table measure
table | grep -q '^distances ' || fail "a row of distances was expected"
[ "$(table | grep -c '^march_')" -ge 5 ] || fail "rows of march were expected"
grep -q '"kernels"' m.json || fail "the report should hold the kernels"
# A kernel object for each row, two counts that hold whatever the work was, and launches as in the table.
number() { sed -n "s/^.*\"$1\":[[:space:]]*\([0-9]*\).*/\1/p" m.json | head -n 1; }
launches=$(sed -n '/"profile"/,/}/s/.*"launches":[[:space:]]*\([0-9]*\).*/\1/p' m.json | head -n 1)
[ "$launches" = "$(table | awk '{ n = $2 } END { print n }')" ] || fail "launches: $launches"
[ "$(number bytes_from_device)" -gt "$(number blocking_reads)" ] || fail "reads of a byte or more each"
[ "$(number bytes_to_device)" -gt 0 ] || fail "something is written"
[ "$(number buffers_created)" -gt 0 ] || fail "buffers are created"
[ "$(number kernels_created)" -ge "$(table | grep -cv '^all_else\|^measure')" ] || fail "kernels are created"
run "$OVOID" measure a.xyzr a.ovoid --report m.json
expect_code 0
grep -q "all else" "$out" && fail "no table was asked for"
grep -q '"kernels"' m.json && fail "no kernels were asked for"
expect_files a.xyzr a.ovoid r.json t.csv m.json
