# A signal ends the work, says so, and leaves the folder as it was. A pipe that nobody reads holds the
# program where a signal is to meet it, so that it does not matter how fast the machine is.
need_device
make_helix 40 a.xyzr
make_helix 1000 ../big.xyzr
echo old >a.ovoid
mkfifo ../trace ../model ../input

# Shells start background jobs with SIGINT ignored.
env --default-signal=INT true 2>/dev/null || skip "env cannot reset signals"

# start OPTION...: a fit in the background that signals reach.
start() {
    last="ovoid fit $*, then a signal"
    env --default-signal=INT "$OVOID" fit "$@" >"$out" 2>"$err" &
    pid=$!
}

expect_untouched() {
    expect_files a.xyzr a.ovoid
    [ "$(cat a.ovoid)" = old ] || fail "the old model should be untouched"
}

# A fit without end. Its trace has a first block once it iterates. (While a driver compiles, its
# compiler may have signal handlers of its own.)
for signal in INT:130 TERM:143 HUP:129; do
    start a.xyzr --method l1 --iterations 4000000000 --trace t.csv --report r.json
    await_writing
    kill -s "${signal%:*}" $pid
    finish
    expect_code "${signal#*:}"
    expect_err "ovoid: error: interrupted"
    expect_untouched
done

# Method adaptive ends by itself, but with so many repairs late: what came to the second level has
# not been interrupted in the first.
start ../big.xyzr --ratio 0.2 --effort 10 --levels 3 -o a.ovoid --trace ../trace --report r.json
exec 8<../trace
read -r heading <&8 # with the first block
kill -s INT $pid
grep -q '^2,' <&8 && fail "the fit should have ended"
finish
exec 8<&-
[ "${heading%%,*}" = level ] || fail "the trace should have a heading"
expect_code 130
expect_err "ovoid: error: interrupted"
expect_untouched

# What cannot ask, here a write that waits, is given up a moment later, and nothing is left of it, nor
# of the trace that is under way: the model is larger than what a pipe takes.
for signal in INT:130 TERM:143; do
    start ../big.xyzr --method l1 --iterations 1 --no-measure -o ../model --trace t.csv
    exec 8<../model
    read -r heading <&8 # so that its end is open for good
    [ -n "$(find . -name '.ovoid-*.tmp')" ] || fail "the trace should be under way"
    kill -s "${signal%:*}" $pid
    finish
    exec 8<&-
    expect_code "${signal#*:}"
    expect_err "ovoid: error: interrupted"
    [ "$(grep -c interrupted "$err")" -eq 1 ] || fail "once is enough"
    expect_untouched
done

# A second signal is not waited for.
start ../big.xyzr --method l1 --iterations 1 --no-measure -o ../model --trace t.csv
exec 8<../model
read -r heading <&8
kill -s INT $pid
kill -s TERM $pid
finish
exec 8<&-
[ "$code" -eq 130 ] || [ "$code" -eq 143 ] || fail "one of the signals should be the reason"
expect_err "ovoid: error: interrupted"
expect_untouched

# A job started with SIGINT ignored, as by nohup or '&', goes on. Its trace, too, is larger than what
# a pipe takes.
last="ovoid fit a.xyzr with SIGINT ignored, then SIGINT"
(trap '' INT && exec "$OVOID" fit a.xyzr --method l1 --iterations 2000 -o b.ovoid --trace ../trace \
    >"$out" 2>"$err") &
pid=$!
exec 8<../trace
read -r heading <&8
kill -s INT $pid
[ "$(wc -c <&8)" -gt 100000 ] || fail "the trace should be longer"
finish
exec 8<&-
expect_code 0
expect_files a.xyzr a.ovoid b.ovoid

# Waiting for standard input, it ends at once. What a pipe does not take has been read.
last="ovoid fit - without an end of the input, then SIGINT"
env --default-signal=INT "$OVOID" fit - -o c.ovoid <../input >"$out" 2>"$err" &
pid=$!
exec 9>../input
yes "0 0 0 1" | head -c 200000 >&9
kill -s INT $pid
finish
exec 9>&-
expect_code 130
expect_err "interrupted"
expect_files a.xyzr a.ovoid b.ovoid
