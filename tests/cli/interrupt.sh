# A signal ends the work, says so, and leaves the folder as it was.
need_device
make_helix 40 a.xyzr
echo old >a.ovoid

# Shells start background jobs with SIGINT ignored.
env --default-signal=INT true 2>/dev/null || skip "env cannot reset signals"

# Waits until process $pid iterates: then its trace, still under another name, has a first block.
# (While a driver compiles, its compiler may have signal handlers of its own.)
await_iterations() {
    tries=0
    until [ -n "$(find . -name '.ovoid-*.tmp' -size +0)" ]; do
        tries=$((tries + 1))
        [ $tries -lt 600 ] && kill -0 $pid || fail "the fit did not start"
        sleep 0.05
    done
}

# start WHAT: $fit, a fit without end.
start() {
    last="ovoid fit $fit --trace t.csv --report r.json, then $*"
    env --default-signal=INT "$OVOID" fit $fit --trace t.csv --report r.json >"$out" 2>"$err" &
    pid=$!
    await_iterations
}

fit="a.xyzr --method l1 --iterations 4000000000"
for signal in INT:130 TERM:143 HUP:129; do
    start "SIG${signal%:*}"
    kill -s "${signal%:*}" $pid
    wait $pid
    code=$?
    expect_code "${signal#*:}"
    expect_err "ovoid: error: interrupted"
    expect_files a.xyzr a.ovoid
    [ "$(cat a.ovoid)" = old ] || fail "the old model should be untouched"
done

# Method adaptive ends by itself, but with so many repairs only after minutes: who waits for that
# has not been interrupted.
make_helix 1000 ../big.xyzr
l1=$fit
fit="../big.xyzr --ratio 0.2 --effort 10 --levels 3 -o a.ovoid"
start SIGINT
kill -s INT $pid
(sleep 30 && kill -s KILL $pid) >/dev/null 2>&1 &
watchdog=$!
wait $pid
code=$?
kill $watchdog
expect_code 130
expect_err "ovoid: error: interrupted"
expect_files a.xyzr a.ovoid
[ "$(cat a.ovoid)" = old ] || fail "the old model should be untouched"
fit=$l1

# The second signal kills at once, and even then nothing is left.
start "SIGINT, SIGTERM"
kill -s STOP $pid
kill -s INT $pid
kill -s TERM $pid
kill -s CONT $pid
wait $pid
code=$?
[ "$code" -gt 128 ] || fail "a killing signal was expected"
grep -q interrupted "$err" && fail "the program should not have lived to say a word"
expect_files a.xyzr a.ovoid

# A job started with SIGINT ignored, as by nohup or '&', goes on.
last="ovoid fit a.xyzr with SIGINT ignored, then SIGINT"
(trap '' INT && exec "$OVOID" fit a.xyzr --method l1 --iterations 3000 -o b.ovoid --trace t.csv \
    >"$out" 2>"$err") &
pid=$!
await_iterations
kill -s INT $pid
wait $pid
code=$?
expect_code 0
expect_files a.xyzr a.ovoid b.ovoid t.csv

# Waiting for standard input, it ends at once.
last="ovoid fit - without input, then SIGINT"
mkfifo ../never
env --default-signal=INT "$OVOID" fit - -o c.ovoid <../never >"$out" 2>"$err" &
pid=$!
exec 9>../never
sleep 0.5
kill -s INT $pid
wait $pid
code=$?
exec 9>&-
expect_code 130
expect_err "interrupted"
expect_files a.xyzr a.ovoid b.ovoid t.csv
