# Fits in parts: side by side to the same file, killed and resumed to the same file.
need_device
make_chain 1600 a.xyzr

run "$OVOID" fit a.xyzr -o one.ovoid --ratio 0.05 --effort 0 --part-atoms 64 --report r.json --no-measure
expect_code 0
expect_out "parts"
grep -q '^goal      0.05 ellipsoids per atom: reached$' "$out" || fail "no part's distance should be told as that of all"
parts=$(sed -n 's/.*"parts":[^0-9]*\([0-9]*\).*/\1/p' r.json)
[ "$parts" -ge 25 ] || fail "1600 atoms in parts of 64 at most should be 25 or more, not $parts"
run "$OVOID" fit a.xyzr -o two.ovoid --ratio 0.05 --part-atoms 64
expect_code 0
told=$(sed -n 's/^goal .*, outer surfaces within \([0-9.]*\).*/\1/p' "$out")
expect_out "deviation ${told:?the distance should be told} Å"
run "$OVOID" fit a.xyzr -o two.ovoid --ratio 0.05 --effort 0 --part-atoms 64 --jobs 2 --no-measure -q
expect_code 0
cmp -s one.ovoid two.ovoid || fail "two jobs should make the model that one makes"

# Killed as soon as there is another part, again and again; at the end nobody kills it.
size_of() {
    wc -c <"$1" 2>/dev/null || echo 0
}
kills=0
size=0
last="ovoid fit with a checkpoint, killed and resumed"
while [ $kills -lt 20 ]; do
    "$OVOID" fit a.xyzr -o three.ovoid --ratio 0.05 --effort 0 --part-atoms 64 --no-measure -q --checkpoint c --resume >"$out" 2>"$err" &
    pid=$!
    while [ "$(size_of c)" -le "$size" ] && kill -0 $pid 2>/dev/null; do sleep 0.01; done
    kill -s KILL $pid 2>/dev/null || break
    wait $pid 2>/dev/null
    kills=$((kills + 1))
    size=$(size_of c)
    [ ! -e three.ovoid ] || fail "there should be no model after a kill"
done
# On a busy machine parts are done between looks, and the last one before 20 kills.
[ $kills -ge 10 ] || fail "10 kills at least were to be survived, not $kills"
run "$OVOID" fit a.xyzr -o three.ovoid --ratio 0.05 --effort 0 --part-atoms 64 --no-measure -q --checkpoint c --resume --jobs 2
expect_code 0
cmp -s one.ovoid three.ovoid || fail "a fit that was killed $kills times should come to the same model"
[ ! -e c ] || fail "the checkpoint should be gone when the model is there"

# One that is of another fit, or in the way.
echo no >c
run "$OVOID" fit a.xyzr -o four.ovoid --ratio 0.05 --effort 0 --part-atoms 64 --checkpoint c
expect_code 4
expect_err "c is there already"
run "$OVOID" fit a.xyzr -o four.ovoid --ratio 0.05 --effort 0 --part-atoms 64 --checkpoint c --resume
expect_err "c is no checkpoint"
[ "$(cat c)" = no ] || fail "what is no checkpoint should stay"
run "$OVOID" fit a.xyzr --part-atoms 10
expect_code 2
expect_err "parts.atoms"
run "$OVOID" fit a.xyzr --resume
expect_code 2
expect_err "--checkpoint FILE"
run "$OVOID" fit a.xyzr --checkpoint d --levels 2
expect_code 2
run "$OVOID" fit a.xyzr a.xyzr --checkpoint d
expect_code 2
run "$OVOID" fit a.xyzr --method l1 --jobs 2
expect_code 2
expect_files a.xyzr c one.ovoid two.ovoid three.ovoid r.json
