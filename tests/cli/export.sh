# Files for other programs: what is written follows the extension, from a model or a molecule.
make_helix 6 a.xyzr
cat >m.ovoid <<'END'
# ovoid model 1
# decay: 0.5
# isovalue: 1
# amplitude decay1 decay2 decay3 x y z alpha beta gamma
2.5 0.1 0.2 0.3 1 -2 3.25 0.5 0 -1
0.5 0.2 0.2 0.2 4 -2 3.25 0 0 0
END

for command in "export --help" "export -h" "help export"; do
    run "$OVOID" $command
    expect_code 0
    expect_silent
    for text in "Usage: ovoid export INPUT" "Exit codes:" "Examples:" "OVOID_DEVICE" ".bild" ".cxc" \
        ".py" ".gmm" ".json" ".xyz" ".lmp" ".pdb" ".gltf" ".cif" ".mrc" ".dx" ".html" ".3mf" ".vert" --colour-by --output --as --format --device --quiet --isovalue \
        --spacing --decay --colour --opacity; do
        expect_out "$text"
    done
done

# Ellipsoids need no device.
for name in m.bild m.cxc m.py m.gmm m.json m.xyz m.lmp m.pdb m.gltf m.cif; do
    run env OVOID_DEVICE="no such device" "$OVOID" export m.ovoid -o $name
    expect_code 0
    expect_silent
    expect_out "m.ovoid: 2 ellipsoids, written to $name as "
done
grep -q '"amplitude": 2.5' m.json || fail "the JSON should hold the model"
run "$OVOID" export m.ovoid -o m.cxc --colour ff8000 --opacity 0 --isovalue 2 -q
expect_code 0
expect_no_out
grep -q 'color #ff800000 ' m.cxc || fail "colour and opacity should be as asked"
grep -q 'at isovalue 2$' m.cxc || fail "the isovalue should be as asked"
expect_files a.xyzr m.ovoid m.bild m.cxc m.py m.gmm m.json m.xyz m.lmp m.pdb m.gltf m.cif
rm m.xyz m.lmp m.pdb m.gltf m.cif
run "$OVOID" export a.xyzr m.ovoid -o m.cif
expect_code 0
expect_out "a.xyzr: 6 atoms, 2 ellipsoids, written to m.cif as ihm"
rm m.cif

# Standard streams; a model is known by its first line, whatever its name.
cp m.ovoid other.txt
run "$OVOID" export other.txt --as json -o -
expect_code 0
expect_silent
cmp -s "$out" m.json || fail "standard output should be as the file"
"$OVOID" export - --as json -o piped.json <m.ovoid >"$out" 2>"$err"
code=$?
expect_code 0
expect_out "standard input: 2 ellipsoids"
cmp -s piped.json m.json || fail "standard input should be as the file"
rm other.txt m.bild m.cxc m.py m.gmm m.json piped.json

wrong() {
    wanted=$1
    text=$2
    shift 2
    run "$OVOID" export "$@"
    expect_code "$wanted"
    expect_no_out
    expect_err "ovoid: error: "
    expect_err "$text"
    expect_files a.xyzr m.ovoid
}
wrong 2 "which model?"
wrong 2 "one input at a time, but 'b' follows 'm.ovoid'" m.ovoid b -o m.py
wrong 2 "a molecule and one model at a time, but 'n.ovoid' follows 'm.ovoid'" a.xyzr m.ovoid n.ovoid -o m.cif
wrong 2 "--colour-by takes difference, chain, residue, ellipsoid or none, not 'atom'" a.xyzr -o a.ply --colour-by atom
wrong 2 "one input at a time, but 'n.ovoid' follows 'm.ovoid'" m.ovoid n.ovoid -o m.ply
wrong 2 "only one input can come from standard input" - - -o m.html
wrong 2 "where to?" m.ovoid
wrong 2 "are the same file" m.ovoid -o ./m.ovoid
wrong 2 "one of .bild, .cxc, .py, .gmm, .json, .xyz, .lmp, .pdb, .gltf, .cif, .mrc, .map, .ccp4, .dx, .ply, .glb, .3mf, .vert, .html" m.ovoid -o m.xtc
wrong 2 "name a format" m.ovoid -o -
wrong 2 "--as takes bild, cxc, pymol, gmm, json, ccp4, dx, html, ihm, xyz, lammps, anisou, splat, ply, glb, 3mf or msms, not 'xtc'" m.ovoid -o - --as xtc
wrong 2 "--colour takes six hexadecimal digits such as 4d8ccc, not 'red'" m.ovoid -o m.py --color red
wrong 2 "--opacity is 2, but must be at most 1" m.ovoid -o m.py --opacity 2
for name in r.mrc r.MRC r.dx r.py; do
    wrong 2 "json is asked for, but the name '$name' says" m.ovoid -o $name --as json
done
wrong 2 "dx is asked for, but the name 'r.map' says ccp4" a.xyzr -o r.map --as dx
wrong 2 "--max-gigabytes is 0, but must be above 0" m.ovoid -o m.mrc --max-gigabytes 0
wrong 2 "--spacing is 0, but must be above 0" m.ovoid -o m.mrc --spacing 0
wrong 2 "did you mean '--spacing'?" m.ovoid -o m.mrc --spcing 1
wrong 2 "a molecule has no ellipsoids" a.xyzr -o a.py
wrong 2 "--format takes pdb, mmcif, pqr, xyzr or ovoid, not 'mol2'" a.xyzr -o m.py --format mol2
wrong 3 "missing.ovoid" missing.ovoid -o m.py
wrong 4 "there is no folder 'no'" m.ovoid -o no/m.py
wrong 4 "Is a directory" m.ovoid -o .
if [ -w /dev/full ]; then
    wrong 4 "cannot write '/dev/full': No space left on device" m.ovoid -o /dev/full --as json
    "$OVOID" export m.ovoid -o - --as gmm >/dev/full 2>"$err"
    code=$?
    expect_code 4
    expect_err "cannot write standard output: No space left on device"
fi

need_device
wrong 2 "MSMS's files are two" a.xyzr -o - --as msms
wrong 2 "they take a molecule" m.ovoid -o m.vert
wrong 2 "colours by difference take a molecule and a model" a.xyzr -o a.ply --colour-by difference
wrong 2 "colours by chain or residue take a molecule" m.ovoid -o m.ply --colour-by residue
wrong 2 "does not name its residues: no colours by chain" a.xyzr -o a.ply --colour-by chain
wrong 5 "no such device" a.xyzr -o a.mrc --device "no such device"
wrong 6 "choose a larger spacing" a.xyzr -o a.mrc --spacing 1e-5
# A map that would be mostly nothing is not written without a word: its size is named.
printf '0 0 0 1.5\n1e6 0 0 1.5\n' >far.xyzr
"$OVOID" export far.xyzr -o far.mrc >"$out" 2>"$err"
code=$?
expect_code 6
expect_err "take 2.31 GB, more than 1 GB: choose a larger spacing, or allow more (max-gigabytes)"
[ ! -e far.mrc ] || fail "a map over the limit should not be written"
"$OVOID" export far.xyzr -o far.mrc --spacing 20 --max-gigabytes 1e-3 >"$out" 2>"$err"
code=$?
expect_code 6
"$OVOID" export far.xyzr -o far.mrc --spacing 20 --max-gigabytes 1e-2 >"$out" 2>"$err"
code=$?
expect_code 0
rm -f far.xyzr far.mrc
for name in a.mrc a.map a.ccp4 a.dx; do
    run "$OVOID" export a.xyzr -o $name --spacing 1 --decay 0.4
    expect_code 0
    expect_silent
    expect_out "a.xyzr: 6 atoms, written to $name as "
done
cmp -s a.mrc a.map || fail "two runs should give the same map"
grep -aq 'field of 6 atoms, decay 0.4 ' a.mrc || fail "the map should say what it is"
"$OVOID" export - --format xyzr --as mrc --spacing 1 --decay 0.4 -o b.mrc <a.xyzr >"$out" 2>"$err"
code=$?
expect_code 0
cmp -s a.mrc b.mrc || fail "standard input should be as the file"

# A page of a molecule, of models, of both; the device is asked for, and a full disk is no page.
for inputs in a.xyzr m.ovoid "a.xyzr m.ovoid" "m.ovoid m.ovoid" "a.xyzr m.ovoid m.ovoid"; do
    run "$OVOID" export $inputs -o a.html --spacing 1
    expect_code 0
    expect_silent
    expect_out " written to a.html as html"
done
expect_out "a.xyzr: 6 atoms, 2 / 2 ellipsoids, written"
"$OVOID" export - m.ovoid m.ovoid --format xyzr --as html --spacing 1 -o - <a.xyzr >b.html 2>"$err"
code=$?
expect_code 0
expect_silent
grep -q '"atoms":6' b.html || fail "standard input should be the molecule"
[ "$(grep -c octet-stream b.html)" -eq "$(grep -c octet-stream a.html)" ] || fail "the same blocks"
run "$OVOID" export m.ovoid a.xyzr -o x.html
expect_code 3
expect_err "a.xyzr"
run "$OVOID" export a.xyzr m.ovoid -o x.html --device "no such device"
expect_code 5
if [ -w /dev/full ]; then
    run "$OVOID" export a.xyzr m.ovoid -o /dev/full --as html --spacing 1
    expect_code 4
    expect_err "No space left on device"
fi
[ ! -e x.html ] || fail "what failed should leave nothing"
rm a.html b.html

# What is appended to, like a pipe, cannot be gone back in: the map follows what was there.
cp a.mrc c.mrc
"$OVOID" export a.xyzr -o - --as mrc --spacing 1 --decay 0.4 >>c.mrc 2>"$err"
code=$?
expect_code 0
size=$(($(wc -c <a.mrc)))
[ $(($(wc -c <c.mrc))) -eq $((2 * size)) ] || fail "a whole map should be appended"
head -c $size c.mrc | cmp -s - a.mrc || fail "what was there should stay"
tail -c $((size - 1024)) a.mrc >a.values
tail -c $((size - 1024)) c.mrc | cmp -s - a.values || fail "the values should be the same"

# Ctrl-C leaves nothing.
rm -f a.mrc a.map a.ccp4 a.dx b.mrc c.mrc a.values
env --default-signal=INT true 2>/dev/null || skip "env cannot reset signals"
last="ovoid export a.xyzr -o a.dx --spacing 0.01, then SIGINT"
env --default-signal=INT "$OVOID" export a.xyzr -o a.dx --spacing 0.01 --max-gigabytes 1e3 >"$out" 2>"$err" &
pid=$!
await_writing
kill -s INT $pid
finish
expect_code 130
expect_err "ovoid: error: interrupted"
expect_files a.xyzr m.ovoid
