# The table of owners: a row per atom with the ellipsoid that it became part of.
need_device
make_chain 60 a.xyzr
run "$OVOID" fit a.xyzr --ellipsoids 10 -q
expect_code 0
mv a.ovoid ../plain.ovoid
run "$OVOID" fit a.xyzr --ellipsoids 10 --levels 2 --owners o.csv --report r.json
expect_code 0
expect_silent
expect_out "owners    written to o.csv"
expect_files a.xyzr a.ovoid a.level2.ovoid o.csv o.level2.csv r.json
grep -q '"owners":[[:space:]]*"o.level2.csv"' r.json || fail "the report should name the owners' file"

header=atom,x,y,z,ellipsoid,serial,name,element,residue,number,insertion,chain,placement

# expect_owners TABLE MODEL COUNT: every atom once, where the molecule has it, every ellipsoid owns
# one, and of most atoms the owner is among the three ellipsoids with the largest values at the centre,
# computed from the model file by the formulas of README.md.
expect_owners() {
    [ "$(head -n 1 "$1")" = "$header" ] || fail "$1 has no header"
    awk -v count="$3" -v table="$1" -v model="$2" '
        function problem(text) { print table ": " text; bad = 1; exit 1 }
        FILENAME == model { if ($0 !~ /^(#|amplitude)/) {
            n++; a[n] = $1; p1[n] = $2; p2[n] = $3; p3[n] = $4; x[n] = $5; y[n] = $6; z[n] = $7
            al[n] = $8; be[n] = $9; ga[n] = $10 }; next }
        FILENAME == table { if (FNR == 1) next
            split($0, f, ","); t++
            if (f[1] != t) problem("atom " t " is called " f[1])
            if (f[5] !~ /^[0-9]+$/ || f[5] < 1 || f[5] > n) problem("there is no ellipsoid " f[5])
            owner[t] = f[5]; owns[f[5]] = 1; at[t] = f[2] " " f[3] " " f[4]; next }
        { m++; split(at[m], c, " ")
            if (c[1] != $1 + 0 || c[2] != $2 + 0 || c[3] != $3 + 0) problem("atom " m " is elsewhere")
            above = 0
            for (i = 1; i <= n; i++) {
                u = $1 - x[i]; v = $2 - y[i]; w = $3 - z[i]
                v1 = cos(al[i]) * v - sin(al[i]) * w; w1 = sin(al[i]) * v + cos(al[i]) * w
                u2 = cos(be[i]) * u - sin(be[i]) * w1; w2 = sin(be[i]) * u + cos(be[i]) * w1
                u3 = cos(ga[i]) * u2 - sin(ga[i]) * v1; v3 = sin(ga[i]) * u2 + cos(ga[i]) * v1
                value[i] = log(a[i]) - p1[i] * u3 ^ 2 - p2[i] * v3 ^ 2 - p3[i] * w2 ^ 2
            }
            for (i = 1; i <= n; i++) above += value[i] > value[owner[m]]
            near += above < 3 }
        END { if (bad) exit 1
            if (n != count || t != m) problem(t " rows for " m " atoms, " n " ellipsoids")
            for (i = 1; i <= n; i++) if (!owns[i]) problem("ellipsoid " i " owns no atom")
            if (near < 0.9 * m) problem("only " near " of " m " atoms at their largest ellipsoids") }
        ' "$2" "$1" a.xyzr || fail "the owners in $1 do not fit $2"
}
expect_owners o.csv a.ovoid 10
expect_owners o.level2.csv a.level2.ovoid 5

# It changes nothing about the model.
cp a.ovoid ../with.ovoid
grep -v '^# level' ../with.ovoid | cmp -s - ../plain.ovoid || fail "the model should be the same"
rm ./*.ovoid ./*.csv r.json

# Method l1, and a tolerance.
run "$OVOID" fit a.xyzr --method l1 --iterations 60 --owners o.csv
expect_code 0
expect_owners o.csv a.ovoid "$(grep -cv '^#' a.ovoid)"
run "$OVOID" fit a.xyzr --tolerance 0.3 --owners o.csv
expect_code 0
expect_owners o.csv a.ovoid "$(grep -cv '^#' a.ovoid)"

# On standard output, and where nothing can be written.
run "$OVOID" fit a.xyzr --ellipsoids 3 --owners - -q
expect_code 0
[ "$(wc -l <"$out")" -eq 61 ] || fail "the owners should be on standard output"
rm o.csv a.ovoid
run "$OVOID" fit a.xyzr --owners no/o.csv
expect_code 4
expect_err "there is no folder 'no'"
expect_files a.xyzr
if [ -w /dev/full ]; then
    run "$OVOID" fit a.xyzr --ellipsoids 3 --owners /dev/full
    expect_code 4
    expect_err "cannot write '/dev/full': No space left on device"
    expect_out "model     written to a.ovoid"
    grep -q "^owners" "$out" && fail "the owners were not written"
    expect_files a.xyzr a.ovoid
fi

# What the molecule's file calls its atoms, quoted where it would end a cell; of an assembly also the
# placement.
rm -f ./*
cat >named.pdb <<'END'
REMARK 350 BIOMOLECULE: 1
REMARK 350 APPLY THE FOLLOWING TO CHAINS: A
REMARK 350   BIOMT1   1  1.000000  0.000000  0.000000        0.00000
REMARK 350   BIOMT2   1  0.000000  1.000000  0.000000        0.00000
REMARK 350   BIOMT3   1  0.000000  0.000000  1.000000        0.00000
REMARK 350   BIOMT1   2  1.000000  0.000000  0.000000        9.00000
REMARK 350   BIOMT2   2  0.000000  1.000000  0.000000        0.00000
REMARK 350   BIOMT3   2  0.000000  0.000000  1.000000        0.00000
ATOM      7  N   GLY A  12B      1.000   2.000   3.000  1.00  0.00           N
HETATM    9  C,1 LIG A  13       2.400   2.000   3.000  1.00  0.00           C
END
run "$OVOID" fit named.pdb --ellipsoids 1 --owners o.csv -q
expect_code 0
printf '%s\n' "$header" 1,1,2,3,1,7,N,N,GLY,12,B,A, '2,2.4,2,3,1,9,"C,1",C,LIG,13,,A,' >../wanted
cmp o.csv ../wanted || fail "the atoms should be named: $(cat o.csv)"
run "$OVOID" fit named.pdb --assembly 1 --ellipsoids 1 --owners o.csv -q
expect_code 0
[ "$(tail -n 1 o.csv)" = '4,11.4,2,3,1,9,"C,1",C,LIG,13,,A,2' ] ||
    fail "the last atom should be of placement 2: $(cat o.csv)"
