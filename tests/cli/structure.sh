# PDB and mmCIF files: what the commands take, and what summaries and reports say of them.
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
ATOM      3  CB AALA A   5      12.639   6.071  -5.147  0.40 20.00           C
ATOM      4  CB BALA A   5      12.700   6.500  -5.000  0.60 20.00           C
ATOM      5  C   ALA A   5      12.559   7.231  -4.900  0.00 20.00           C
HETATM    6  X1  UNX A   6      14.000   7.231  -4.900  1.00 20.00           X
HETATM    7  O   HOH A 201      30.000   0.000   0.000  1.00 30.00           O
END
EOF

run "$OVOID" fit a.pdb -o a.ovoid --report a.json --no-measure
expect_code 0
expect_err "a.pdb: radii of 1 atom are guessed: X1 of UNX (1.7 Å)"
expect_out "molecule  a.pdb: 5 atoms, 1 of them of occupancy 0, 2 skipped (1 of waters, 1 at other alternate locations)"
expect_out "radii     united, as there are no hydrogens: they stand for those, too; 1 guessed"
for line in '"format":	"pdb"' '"atoms":	5' '"unit_atoms":	5' '"atoms_skipped":	2' \
    '"atoms_skipped_waters":	1' '"atoms_skipped_altlocs":	1' '"zero_occupancy_atoms":	1' \
    '"hydrogens":	0' '"radii":	"united"' '"guessed_radii":	1' '"residue":	"UNX"' \
    '"assembly":	null' '"models":	1'; do
    grep -qF "$line" a.json || fail "the report lacks $line"
done

# Compressed, from standard input, which the contents tell.
gzip -k a.pdb
"$OVOID" fit - -o b.ovoid --quiet --no-measure <a.pdb.gz 2>"$err" || fail "standard input"
grep -v '^# ' a.ovoid >one && grep -v '^# ' b.ovoid >two
cmp -s one two || fail "standard input gives another model"
rm -f one two b.ovoid a.json a.pdb.gz

run "$OVOID" fit a.pdb --assembly list
expect_code 0
expect_out "a.pdb: 5 atoms in the file"
expect_out "1                    2            10"
run "$OVOID" mesh a.pdb --assembly 1 --select '[!X]' -o a.ply
expect_code 0
expect_out "molecule  a.pdb: 8 atoms"
expect_out "assembly  1: 2 placements of 4 atoms of the file, 0.0 MB"
expect_out "1 not selected"
expect_out "2 of them outer"
run "$OVOID" mesh a.pdb --assembly 7 -o a.ply
expect_code 2
expect_err "a.pdb: no assembly 7: the file has 1"

# Its two placements turn into each other: one is fitted for both, unless that is not wanted.
run "$OVOID" fit a.pdb --assembly 1 --ellipsoids 4 --no-measure -o b.ovoid --report b.json
expect_code 0
expect_out "one of 2 units"
grep -qF '"units":	2' b.json || fail "the report should tell of 2 units"
grep -q "^# .*units 2" b.ovoid || fail "the model should tell of 2 units"
expect_out "4 ellipsoids for 10 atoms: sparse ratio 0.4, 2 placements of 2"
for option in "--ellipsoids 3" "--ellipsoids 4 --no-symmetry"; do
    run "$OVOID" fit a.pdb --assembly 1 $option --no-measure -o b.ovoid --report b.json
    expect_code 0
    grep -qF '"units":	1' b.json || fail "all atoms should be fitted with $option"
done
rm -f b.ovoid b.json

for command in "measure a.pdb a.ovoid --report b.json" "render a.pdb a.ovoid -o a.png --size 64x48" \
    "export a.pdb -o a.dx"; do
    run "$OVOID" $command --radii bondi
    expect_code 0
    [ "${command%% *}" = export ] || expect_out "radii     bondi; 1 guessed"
done
grep -qF '"radii":	"bondi"' b.json || fail "the report of measure does not name the radii"

printf 'C 1.9\nN 1.5\nUNX X1 2\n' >r.txt
run "$OVOID" mesh a.pdb -o a.ply --radii r.txt
expect_code 0
expect_out "radii     r.txt"
echo 'C' >r.txt
run "$OVOID" mesh a.pdb -o a.ply --radii r.txt
expect_code 3
expect_err "r.txt:1:1: 'residue atom radius' or 'element radius' is expected"
run "$OVOID" mesh a.pdb -o a.ply --radii nonsense
expect_code 3
expect_err "nonsense: cannot open"

run "$OVOID" fit a.pdb --select '((' -o c.ovoid
expect_code 2
expect_err "selection: "
run "$OVOID" fit a.pdb --model 2 -o c.ovoid
expect_code 3
expect_err "no model 2: the file has 1, number 1 to 1"
run "$OVOID" fit a.pdb --model 0 -o c.ovoid
expect_code 2
expect_err "--model is 0, but must be at least 1"
run "$OVOID" mesh a.ovoid -o c.ply --waters
expect_code 2
expect_err "--waters is for molecules, but 'a.ovoid' is a model"
printf '1 2 3 4\n' >a.xyzr
run "$OVOID" fit a.xyzr -o c.ovoid --radii bondi
expect_code 2
expect_err "a.xyzr: an XYZR file holds places and radii alone, and other radii needs more"
expect_files a.pdb a.ovoid a.ply a.png a.dx a.xyzr b.json r.txt
