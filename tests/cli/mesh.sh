# Meshes of molecules and models: what is written and said, and what is refused.
need_device
make_helix 12 a.xyzr
cp a.xyzr ../a.xyzr
run "$OVOID" fit a.xyzr --method l1 --iterations 5 -q --no-measure --isovalue 1.2
expect_code 0

# By default a PLY file under the input's name in the current folder.
run "$OVOID" mesh ../a.xyzr
expect_code 0
expect_silent
expect_out "molecule  ../a.xyzr: 12 atoms"
expect_out "field     decay 0.5 Å⁻²"
expect_out "surface   isovalue 1: 1 piece, 1 of them outer"
expect_out "spacing 0.5 Å, exact vertices"
expect_out "mesh      written to a.ply"
expect_files a.xyzr a.ovoid a.ply
grep -q "^format binary_little_endian" a.ply || fail "a binary PLY file was expected"
vertices=$(sed -n 's/^element vertex //p' a.ply | head -n 1)
expect_out "mesh      $vertices vertices, "

# Every format, quietly, and options that change the mesh.
for extension in obj stl off glb OFF; do
    run "$OVOID" mesh a.xyzr -o "b.$extension" -q
    expect_code 0
    expect_silent
    expect_no_out
    [ -s "b.$extension" ] || fail "b.$extension should hold a mesh"
done
[ "$(sed -n 2p b.off | cut -d ' ' -f 1)" = "$vertices" ] || fail "all formats should hold as many"
measure_of() { sed -n "s/^$1  *\([0-9.]*\) .*/\1/p" "$out"; }
larger() { awk "BEGIN { exit !($1 > $2) }" || fail "$1 should be above $2"; }
run "$OVOID" mesh a.xyzr -o b.ply
area=$(measure_of area)
volume=$(measure_of volume)
run "$OVOID" mesh a.xyzr -o b.ply --spacing 0.3
[ "$(sed -n 's/^mesh  *\([0-9]*\) vertices.*/\1/p' "$out")" -gt "$vertices" ] ||
    fail "finer meshes should have more vertices"
larger 0.005 "($(measure_of area) / $area - 1)^2 * 1000"
run "$OVOID" mesh a.xyzr -o b.ply --isovalue 2
larger "$volume" "$(measure_of volume)"
run "$OVOID" mesh a.xyzr -o b.ply --decay 0.3
larger "$(measure_of volume)" "$volume"
run "$OVOID" mesh a.xyzr -o b.ply --vertices linear
expect_out "linear vertices"
larger "($(measure_of volume) / $volume - 1)^2" 1e-7
larger 1e-3 "($(measure_of volume) / $volume - 1)^2"

# Models bring their isovalue; the contents tell them from molecules.
run "$OVOID" mesh a.ovoid -o b.ply
expect_code 0
expect_out "model     a.ovoid: "
expect_out "surface   isovalue 1.2: "
cp a.ovoid model.txt
run "$OVOID" mesh model.txt --isovalue 1
expect_code 0
expect_out "surface   isovalue 1: "
[ -s model.ply ] || fail "the mesh should be called model.ply"
"$OVOID" mesh - -o stdin.ply <a.ovoid >"$out" 2>"$err"
code=$?
expect_code 0
expect_out "model     standard input: "
"$OVOID" mesh - --format xyzr -o stdin.ply <a.xyzr >"$out" 2>"$err"
code=$?
expect_code 0
expect_out "molecule  standard input: 12 atoms"
for name in one two; do
    run "$OVOID" mesh a.xyzr -o $name.ply -q
done
cmp one.ply two.ply || fail "two runs should give the same mesh"

# Into a pipe, whose large arrays would be elsewhere; nothing is left of these.
mkfifo pipe.ply
cat pipe.ply >two.ply &
mkdir place
run env TMPDIR="$PWD/place" "$OVOID" mesh a.xyzr -o pipe.ply -q
expect_code 0
wait $!
cmp one.ply two.ply || fail "a mesh in a pipe should be the same"
rmdir place || fail "nothing should be left in TMPDIR"

# Large arrays are in the folder of the output, wherever a link to it is: where files may not be
# long, that is what has no room.
mkdir place
ln -s place/three.ply link.ply
run sh -c 'trap "" XFSZ && ulimit -f 16000 && exec "$@"' sh "$OVOID" mesh a.xyzr -o link.ply --spacing 0.02
expect_code 4
expect_err "in a file in folder 'place': File too large"
rmdir place || fail "nothing should be left of a mesh without room"
rm -f ./*.ply ./b.* model.txt

refused() {
    wanted=$1
    text=$2
    shift 2
    run "$OVOID" mesh "$@"
    expect_code "$wanted"
    expect_no_out
    expect_err "ovoid: error: "
    expect_err "$text"
    expect_files a.xyzr a.ovoid
}
refused 2 "which surface?" -o b.ply
refused 2 "one surface at a time, but 'b' follows 'a.xyzr'" a.xyzr b
refused 2 "has to end in .ply, .obj, .stl, .off or .glb" a.xyzr -o b.png
refused 2 "has to end in .ply, .obj, .stl, .off or .glb" a.xyzr -o -
refused 2 "name the mesh's file with -o" -
refused 2 "are the same file" a.xyzr -o ./a.xyzr
refused 2 "--decay is for molecules, but 'a.ovoid' is a model" a.ovoid -o b.ply --decay 1
refused 2 "--vertices takes exact or linear, not 'round'" a.xyzr --vertices round
refused 2 "--format takes pdb, mmcif, pqr, xyzr or ovoid, not 'mol2'" a.xyzr --format mol2
refused 2 "--spacing is 0, but must be above 0 Å" a.xyzr --spacing 0
refused 2 "--isovalue takes a number, not 'x'" a.xyzr --isovalue x
refused 2 "did you mean '--isovalue'?" a.xyzr --isovlue 1
refused 4 "there is no folder 'no'" a.xyzr -o no/b.ply
refused 5 "no such device" a.xyzr --device "no such device"
run "$OVOID" mesh nothing.pqr
expect_code 3
run "$OVOID" mesh a.xyzr --isovalue 1e6
expect_code 3
expect_err "no surface"
expect_files a.xyzr a.ovoid

# Atoms without a radius hardly are what was meant: every command says so.
rm -f ./*
printf '0 0 0 0\n1.2 0 0 0\n0 1.2 0 0\n' >zero.xyzr
for command in "mesh zero.xyzr -o zero.ply" "render zero.xyzr -o zero.png --size 40x30" \
    "export zero.xyzr -o zero.dx" "fit zero.xyzr --ratio 1 -o zero.ovoid" "measure zero.xyzr zero.ovoid"; do
    run "$OVOID" $command
    expect_code 0
    expect_err "warning: zero.xyzr: 3 of 3 atoms have radius 0"
done
