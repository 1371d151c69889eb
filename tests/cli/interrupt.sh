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

# Every command, wherever a signal meets it: before it has begun, at work, or where nobody takes its
# output. It cannot end otherwise, for no file that it writes is read.
rm -f b.ovoid
run "$OVOID" fit a.xyzr --ratio 0.2 --no-measure -q -o ../m.ovoid
expect_code 0
for name in a.ply a.obj a.png a.mrc a.cxc a.json; do mkfifo "../$name"; done

# expect_stopped ARGUMENT...: at different moments, the first of them when the program has just been
# loaded. (A shell that has not yet become the program may lose a signal.)
[ -r /proc/self/comm ] || skip "no /proc to see when a program has been loaded"
expect_stopped() {
    for seconds in 0 0.1 0.5 2; do
        last="ovoid $*, then SIGINT after $seconds s"
        env --default-signal=INT "$OVOID" "$@" >"$out" 2>"$err" </dev/null &
        pid=$!
        until [ "$(cat /proc/$pid/comm)" = "${OVOID##*/}" ]; do :; done
        sleep $seconds
        kill -s INT $pid
        finish
        expect_code 130
        expect_untouched
    done
    expect_err "ovoid: error: interrupted"
    [ "$(wc -l <"$err")" -eq 1 ] || fail "nothing else was to be said"
}
expect_stopped mesh ../big.xyzr -o ../a.ply
expect_stopped mesh ../m.ovoid -o ../a.obj
expect_stopped measure a.xyzr ../m.ovoid --report ../a.json
expect_stopped render ../big.xyzr ../m.ovoid -o ../a.png
expect_stopped export ../big.xyzr -o ../a.mrc
expect_stopped export ../m.ovoid -o ../a.cxc
expect_stopped fit a.xyzr -o ../model --owners o.csv

# A folder's models that were finished stay, and the report tells of them.
last="ovoid fit of two molecules, SIGINT in the second"
cp a.xyzr ../1.xyzr
mkfifo ../2.xyzr
env --default-signal=INT "$OVOID" fit ../1.xyzr ../2.xyzr --ratio 0.2 --out-dir ../made --report r.jsonl \
    >"$out" 2>"$err" &
pid=$!
exec 9>../2.xyzr # waits until the first is done,
sleep 1          # and until it waits for what the second has: a signal just before would be late
kill -s INT $pid
finish
exec 9>&-
expect_code 130
expect_err "interrupted"
[ "$(ls ../made)" = 1.ovoid ] || fail "the first model should be there alone"
[ "$(wc -l <r.jsonl)" -eq 1 ] || fail "the report should tell of the first"
