# The progress line: on a terminal only, gone at the end. What is expected of it here is what the
# states of a fit decide, however fast they follow each other: the first line of each level and of each
# stage. How the clock thins out those between is in tests/test_progress.c.
need_device
make_helix 40 a.xyzr
make_chain 100 b.xyzr
run "$OVOID" fit a.xyzr --method l1 --iterations 50
expect_code 0
expect_silent

script -qec true /dev/null >/dev/null 2>&1 || skip "no program 'script' to make a terminal"
progress='^(level [0-9]*/|[a-z]+  (step )?[0-9]+([ /]|$))'
# on_terminal OPTION...: a fit of $molecule. Leaves the states of the progress line in ../lines, one
# on a line without the codes that erase, and in ../screen what a terminal shows at the end.
on_terminal() {
    last="ovoid fit $molecule $* on a terminal"
    TERM=$terminal script -qec "stty cols $width; '$OVOID' fit $molecule $*" /dev/null >"$out" \
        </dev/null
    code=$?
    expect_code 0
    erase=$(printf '\033\\[K')
    tr '\r' '\n' <"$out" | sed "s/$erase//g" >../lines
    awk '{
        shown = ""
        pieces = split($0, piece, "\r")
        for (i = 1; i <= pieces; i++) {
            erased = sub(/\033\[K/, "", piece[i])
            shown = piece[i] (erased ? "" : substr(shown, length(piece[i]) + 1))
        }
        print shown
    }' "$out" >../screen
    grep -qE "$progress" ../screen && fail "the progress line should be gone at the end"
    return 0
}
expect_line() { grep -q "^$1 *\$" ../lines || fail "a progress line '$1' was expected"; }
expect_summary() {
    grep -q "^model .*written to ${molecule%.xyzr}.ovoid" ../screen || fail "the summary should follow"
}
expect_no_progress() {
    grep -qE "$progress" ../lines && fail "no progress line was expected"
    return 0
}

# Nobody knows how many steps method adaptive takes: no share of them, no bar.
terminal=xterm
width=90
molecule=b.xyzr
on_terminal --ratio 0.3 --levels 3 --no-measure
for level in 1:30 2:15 3:7; do
    label="level ${level%:*}/3"
    expect_line "$label  sample  [0-9]* points  [0-9]* s"
    expect_line "$label  refine  step 1  ${level#*:} ellipsoids  [0-9]* s"
done
grep -qE '^level [0-9].*(\[|%|left|step [0-9]*\/)' ../lines && fail "no progress towards an end is known"
grep -q ' b.level3.ovoid$' ../screen || fail "the summary should follow"
on_terminal --ratio 0.3
expect_line 'refine  step 1  30 ellipsoids  [0-9]* s'
grep -q '^level ' ../lines && fail "without levels there should be no level in the progress line"
expect_summary
on_terminal --ratio 0.3 --quiet
expect_no_progress
run "$OVOID" fit b.xyzr --ratio 0.3
expect_code 0
expect_silent

# Method l1 knows how many there will be at most. The time left is not known of a first line.
molecule=a.xyzr
on_terminal --method l1 --iterations 40
expect_line 'sample  [0-9]* points  [0-9]* s'
expect_line 'sparse  1/40  40 ellipsoids  error [0-9.]*  \[\.*\]'
expect_line 'accuracy  31/40  [0-9]* ellipsoids  error [0-9.]* .* \[#*\.*\]'
expect_summary
width=30
on_terminal --method l1 --iterations 40
expect_line 'sparse  1/40  40 ellipsoids'
awk '/^(sample|sparse|accuracy) / && length($0) > 29 { bad = 1 } END { exit bad }' ../lines ||
    fail "the progress line should fit the terminal"
on_terminal --method l1 --iterations 40 --quiet
expect_no_progress
terminal=dumb
on_terminal --method l1 --iterations 40
expect_no_progress
expect_files a.xyzr b.xyzr a.ovoid b.ovoid b.level2.ovoid b.level3.ovoid
