# The progress line: on a terminal only, gone at the end.
need_device
make_helix 40 a.xyzr
run "$OVOID" fit a.xyzr --method l1 --iterations 50
expect_code 0
expect_silent

script -qec true /dev/null >/dev/null 2>&1 || skip "no program 'script' to make a terminal"
on_terminal() {
    last="ovoid fit a.xyzr $* on a terminal"
    TERM=$terminal script -qec "stty cols $width; '$OVOID' fit a.xyzr $*" /dev/null >"$out" \
        </dev/null
    code=$?
    expect_code 0
    # One line per state of the progress line, without the codes that erase.
    erase=$(printf '\033\\[K')
    tr '\r' '\n' <"$out" | sed "s/$erase//g" >../lines
}
expect_progress() { grep -q '^sparse  *[0-9]*/[0-9]*' ../lines || fail "a progress line was expected"; }
expect_no_progress() { ! grep -q '^sparse  *[0-9]*/' ../lines || fail "no progress line was expected"; }

# Nobody knows how many steps method adaptive takes: no share of them, no bar.
terminal=xterm
width=90
make_chain 100 ../b.xyzr
on_terminal_adaptive() {
    mv a.xyzr ../a.xyzr && cp ../b.xyzr a.xyzr
    on_terminal "$@"
    mv ../a.xyzr a.xyzr
}
on_terminal_adaptive --ratio 0.3 --levels 3
for line in 'level 1/3  sample  [0-9]* points  [0-9]* s' \
    'level 1/3  refine  step [0-9]*  30 ellipsoids  [0-9]* s' \
    'level [23]/3  refine  step [0-9]*  [1-9]5* ellipsoids  [0-9]* s'; do
    grep -q "^$line *\$" ../lines || fail "a progress line '$line' was expected"
done
grep -qE '^level [0-9].*(\[|%|left|step [0-9]*\/)' ../lines && fail "no progress towards an end is known"
tail -c 300 "$out" | grep -q "written to a.ovoid" || fail "the summary should follow"
on_terminal_adaptive --ratio 0.3
grep -q '^refine  step [0-9]*  30 ellipsoids  [0-9]* s *$' ../lines ||
    fail "without levels there should be no level in the progress line"
on_terminal_adaptive --ratio 0.3 --quiet
grep -q '^refine ' ../lines && fail "no progress line was expected"
run "$OVOID" fit a.xyzr --ratio 0.3
expect_code 0
expect_silent

on_terminal --method l1 --iterations 1500
expect_progress
grep -q ' ellipsoids  error .* left  \[' ../lines || fail "the whole progress line was expected"
tail -c 400 "$out" | grep -q "written to a.ovoid" || fail "the summary should follow"
width=30
on_terminal --method l1 --iterations 1500
expect_progress
[ "$(grep '^sparse ' ../lines | awk '{ if (length($0) > n) n = length($0) } END { print n }')" -lt 30 ] ||
    fail "the progress line should fit the terminal"
on_terminal --method l1 --iterations 1500 --quiet
expect_no_progress
terminal=dumb
on_terminal --method l1 --iterations 1500
expect_no_progress
