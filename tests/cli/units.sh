# Symmetric assemblies: files of a unit and its placements, and what reads them.
need_device
cat >a.pdb <<'EOF'
REMARK 350 BIOMOLECULE: 1
REMARK 350 APPLY THE FOLLOWING TO CHAINS: A
REMARK 350   BIOMT1   1  1.000000  0.000000  0.000000        0.00000
REMARK 350   BIOMT2   1  0.000000  1.000000  0.000000        0.00000
REMARK 350   BIOMT3   1  0.000000  0.000000  1.000000        0.00000
REMARK 350   BIOMT1   2 -1.000000  0.000000  0.000000       30.00000
REMARK 350   BIOMT2   2  0.000000 -1.000000  0.000000       20.00000
REMARK 350   BIOMT3   2  0.000000  0.000000  1.000000        0.00000
ATOM      1  N   ALA A   5      11.104   6.134  -6.504  1.00 20.00           N
ATOM      2  CA  ALA A   5      11.639   6.071  -5.147  1.00 20.00           C
ATOM      4  CB BALA A   5      12.700   6.500  -5.000  0.60 20.00           C
ATOM      5  C   ALA A   5      12.559   7.231  -4.900  0.00 20.00           C
HETATM    6  X1  UNX A   6      14.000   7.231  -4.900  1.00 20.00           X
HETATM    7  O   HOH A 201      30.000   0.000   0.000  1.00 30.00           O
END
EOF

run "$OVOID" fit a.pdb --assembly 1 --ellipsoids 4 --no-measure -o b.ovoid --report b.json
expect_code 0
grep -qF '"unit_ellipsoids":	2' b.json || fail "the report should tell of 2 ellipsoids of the unit"
[ "$(grep -vc '^#' b.ovoid)" = 2 ] || fail "the 2 ellipsoids of the unit should be there"
[ "$(head -n 1 b.ovoid)" = "# ovoid model 2" ] || fail "older versions would read the unit alone"
[ "$(grep -c '^# placement: ' b.ovoid)" = 2 ] || fail "2 placements should be there"

# All of them by --expand.
run "$OVOID" fit a.pdb --assembly 1 --ellipsoids 4 --no-measure -o e.ovoid --report e.json --expand
expect_code 0
expect_out "one of 2 units"
grep -q '^model .*placements' "$out" && fail "no placements are left"
grep -qF '"unit_ellipsoids":	4' e.json || fail "the report should tell of all 4 ellipsoids"
[ "$(head -n 1 e.ovoid)" = "# ovoid model 1" ] || fail "what all versions read should be version 1"
[ "$(grep -vc '^#' e.ovoid)" = 4 ] || fail "4 ellipsoids should be there"
grep -v '^#' b.ovoid >one && grep -v '^#' e.ovoid | head -n 2 >two
cmp -s one two || fail "the unit should come first"
rm -f one two b.json e.json
run "$OVOID" fit a.pdb --method l1 --expand -o c.ovoid
expect_code 2
expect_err "--expand is an option of method adaptive, and the method is l1"
run "$OVOID" fit a.pdb --assembly 1 --ellipsoids 4 --no-symmetry --no-measure -o c.ovoid --expand
expect_code 0

# The same to what reads them. Nine digits of a unit are not those of its image, so that bits may differ.
for model in b e; do
    run "$OVOID" measure a.pdb --assembly 1 $model.ovoid
    expect_code 0
    grep -q ', 2 placements of 2' "$out" && echo $model >>placed.txt
    grep -v '^time' "$out" | sed "s/, 2 placements of 2//; s/[be]\\.ovoid/MODEL/" >$model.txt
    run "$OVOID" mesh $model.ovoid -o $model.ply --spacing 0.4
    expect_code 0
    expect_out "2 pieces, 2 of them outer"
    run "$OVOID" render a.pdb --assembly 1 $model.ovoid -o $model.png --size 96x64 --view overlay
    expect_code 0
    for format in cxc bild py gmm json xyz lmp pdb gltf cif mrc; do
        run "$OVOID" export $model.ovoid -o same.$format
        expect_code 0
        expect_out "4 ellipsoids"
        mv same.$format $model.$format
    done
done
[ "$(cat placed.txt)" = b ] || fail "measure should say which model has placements"
cmp b.txt e.txt || fail "measures of the unit and its placements are not those of all"
apart=$(sed -n 's/^deviation *\([0-9.]*\) Å.*/\1/p' b.txt)
awk -v apart="$apart" 'BEGIN { exit !(apart > 0 && apart < 0.1) }' ||
    fail "the model is $apart Å from the assembly"
[ "$(grep -c '^ATOM\|^HETATM' b.pdb)" = 4 ] || fail "4 pseudo-atoms should be written"
for file in cxc bild py gmm xyz lmp pdb cif; do
    [ "$(wc -l <b.$file)" = "$(wc -l <e.$file)" ] || fail "not all ellipsoids are in b.$file"
done
[ "$(wc -c <b.ply)" = "$(wc -c <e.ply)" ] || fail "the meshes are not of the same size"
rm -f [be].* placed.txt

# What is no model of a unit and its placements.
fit_lines() { printf '# ovoid model 2\n%s\n1 0.5 0.5 0.5 0 0 0 0 0 0\n' "$1" >bad.ovoid; }
fit_lines '# placement: 1 0 0 0 1 0 0 0 1 0 0'
run "$OVOID" mesh bad.ovoid -o bad.ply
expect_code 3
expect_err "bad.ovoid:2:35: t3 is missing: a placement is twelve numbers"
fit_lines '# placement: 1 0 0 0 1 0 0 0 -1 0 0 0'
run "$OVOID" measure a.pdb bad.ovoid
expect_code 3
expect_err "bad.ovoid:2:14: placement: its nine first numbers are no rotation"
fit_lines '# none'
run "$OVOID" render a.pdb bad.ovoid -o bad.png
expect_code 3
expect_err "bad.ovoid:3:1: a model file of version 2 has placements before its ellipsoids"
expect_files a.pdb bad.ovoid c.ovoid
