# A molecule from standard input gives the model of the same molecule from a file, in any format.
need_device
make_helix 8 a.xyzr
awk '{ printf "ATOM %d C MOL 1 %s %s %s 0.0 %s\n", NR, $1, $2, $3, $4 }' a.xyzr >a.pqr
few="--method l1 --iterations 10 -q"
run "$OVOID" fit a.xyzr $few -o a.ovoid
expect_code 0
for source in "cat a.xyzr" "cat a.pqr" "gzip -c a.xyzr" "gzip -c a.pqr"; do
    $source | "$OVOID" fit - $few -o b.ovoid 2>"$err"
    code=$?
    expect_code 0
    expect_silent
    grep -q '^# input: -$' b.ovoid || fail "the input should be called -"
    [ "$(grep -v '^# input' a.ovoid)" = "$(grep -v '^# input' b.ovoid)" ] ||
        fail "'$source' should give the same model"
done
cp a.pqr pqr.txt
run "$OVOID" fit pqr.txt --format pqr $few
expect_code 0
expect_files a.xyzr a.pqr pqr.txt a.ovoid b.ovoid pqr.ovoid
"$OVOID" fit - -o c.ovoid </dev/null 2>"$err"
code=$?
expect_code 3
expect_files a.xyzr a.pqr pqr.txt a.ovoid b.ovoid pqr.ovoid

# A pipe with a name gives its bytes once: none of them may be lost to a look at what they are.
mkfifo pipe
cat a.xyzr >pipe &
run "$OVOID" mesh pipe -o a.obj
wait
rm pipe
expect_code 0
expect_files a.xyzr a.pqr pqr.txt a.ovoid b.ovoid pqr.ovoid a.obj
