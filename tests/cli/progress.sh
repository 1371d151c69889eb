# The progress line: on a terminal only, gone at the end.
need_device
make_helix 40 a.xyzr
run "$OVOID" fit a.xyzr --iterations 50
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

terminal=xterm
width=90
on_terminal --iterations 1500
expect_progress
grep -q ' ellipsoids  error .* left  \[' ../lines || fail "the whole progress line was expected"
tail -c 400 "$out" | grep -q "written to a.ovoid" || fail "the summary should follow"
width=30
on_terminal --iterations 1500
expect_progress
[ "$(grep '^sparse ' ../lines | awk '{ if (length($0) > n) n = length($0) } END { print n }')" -lt 30 ] ||
    fail "the progress line should fit the terminal"
on_terminal --iterations 1500 --quiet
expect_no_progress
terminal=dumb
on_terminal --iterations 1500
expect_no_progress
