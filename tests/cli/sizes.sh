# Molecules and options of unusual size: what is small is found, what is far apart costs nothing, and
# what would take hours is refused at once.
need_device

# Four small atoms far from each other, one of them at a lattice point: four spheres, in every command.
printf '0 0 0 0.2\n0 0 10.41 0.2\n0 0 20.82 0.2\n0 10.27 0 0.2\n' >small.xyzr
near() { awk "BEGIN { exit !(($1) / ($2) > 0.998 && ($1) / ($2) < 1.002) }" || fail "$1 should be about $2"; }
run "$OVOID" mesh small.xyzr
expect_code 0
expect_silent
expect_out "surface   isovalue 1: 4 pieces, 4 of them outer"
near "$(sed -n 's/^area  *\([0-9.]*\) .*/\1/p' "$out")" "4 * 0.50265"
run "$OVOID" fit small.xyzr --report r.json
expect_code 0
expect_silent
expect_out "pieces    4, of the model 4 (outer ones: 4, 4)"
expect_out "reached, "
near "$(sed -n 's/^area  *\([0-9.]*\) .*/\1/p' "$out")" "4 * 0.50265"
run "$OVOID" measure small.xyzr small.ovoid
expect_code 0
expect_silent
expect_out "pieces    4, of the model 4 (outer ones: 4, 4)"
near "$(sed -n 's/^area .* of the model \([0-9.]*\) .*/\1/p' "$out")" "4 * 0.50265"

# One that is too small to be meshed: a warning counts it, and nothing that was measured is a goal.
printf '0 0 0 1.7\n0 5 0 1.7\n0.013 40.021 0.017 0.00001\n' >tiny.xyzr
run "$OVOID" mesh tiny.xyzr
expect_code 0
expect_err "ovoid: warning: 1 atom or ellipsoid makes a surface too small or too thin for the spacing of 0.5"
run "$OVOID" fit tiny.xyzr -o tiny.ovoid
expect_code 7
expect_err "ovoid: warning: the goal was not reached: a mesh spacing of 0.5 Å is too coarse to tell whether"

# An atom far from the others.
printf '0 0 0 1.7\n1.4 0 0 1.7\n2.1 1.2 0 1.7\n9999 9999 9999 1.7\n' >stray.xyzr
for options in "" "--method l1 --iterations 500" "--ellipsoids 3" "--tolerance 0.2"; do
    run "$OVOID" fit stray.xyzr $options
    expect_code 0
    expect_silent
    expect_out "pieces    2, of the model 2 (outer ones: 2, 2)"
done
for command in "mesh stray.xyzr" "measure stray.xyzr stray.ovoid"; do
    run "$OVOID" $command
    expect_code 0
    expect_silent
done
run "$OVOID" render stray.xyzr --size 40x30 -o stray.png
expect_code 0

# Two million angstrom apart, the most there is; and many of them.
printf -- '-1e6 0 0 1.7\n1e6 0 0 1.7\n1e6 1.4 0 1.7\n' >far.xyzr
awk 'BEGIN { for (i = 0; i < 20; i++)
    printf "%.1f %.1f %.1f 1.5\n", i * 90000 - 1e6, i * i * 4000 - 7e5, (i * 7 % 20) * 70000 - 6e5 }' >many.xyzr
for name in far many; do
    for options in "" "--method l1 --iterations 20"; do
        run "$OVOID" fit $name.xyzr $options
        expect_code 0
        expect_silent
    done
done

# What would take hours, with what would do instead.
rm -f ./*.ovoid ./*.ply ./*.png r.json
make_chain 20 a.xyzr
run "$OVOID" fit a.xyzr --ratio 0.5 -q
expect_code 0
refused() {
    last="ovoid $*"
    run "$OVOID" "$@"
    expect_code 6
    expect_err " points at a spacing of "
    expect_err " angstrom, more than 2e+10; use a spacing of about "
    rm -f a.xyzr.report
    expect_files a.xyzr a.ovoid far.xyzr many.xyzr small.xyzr stray.xyzr tiny.xyzr
}
refused mesh a.xyzr --spacing 0.001
refused mesh a.ovoid --spacing 0.001
refused mesh a.xyzr --decay 1e-6
refused measure a.xyzr a.ovoid --spacing 0.001
refused fit a.xyzr -o b.ovoid --spacing 0.001
refused fit a.xyzr -o b.ovoid --mesh-spacing 0.001
refused fit a.xyzr -o b.ovoid --decay 1e-6
refused fit a.xyzr -o b.ovoid --method l1 --spacing 0.001
make_helix 4000 ../big.xyzr
run "$OVOID" mesh ../big.xyzr -o a.ply --decay 1e-4
expect_code 6
expect_err " values of Gaussians at its points at a spacing of 0.5 angstrom, more than 1e+12; use a spacing of about "
expect_files a.xyzr a.ovoid far.xyzr many.xyzr small.xyzr stray.xyzr tiny.xyzr

# A picture as deep as that of atoms all over space.
run "$OVOID" render many.xyzr -o a.png
expect_code 6
expect_err " angstrom along the line of sight are too deep for a picture of so many pixels; take a smaller one"
expect_files a.xyzr a.ovoid far.xyzr many.xyzr small.xyzr stray.xyzr tiny.xyzr
run "$OVOID" render many.xyzr -o a.png --size 40x30
expect_code 0

# A fit that memory is clearly too little for, where the system lets a process be held to it (tools that
# watch memory take all addresses for themselves).
awk 'BEGIN { for (i = 0; i < 500000; i++)
    printf "%d %d %d 1.5\n", i % 1000 * 2, int(i / 1000) % 100 * 2, int(i / 100000) * 2 }' >../many.xyzr
if (ulimit -v 1500000 && "$OVOID" devices) >/dev/null 2>&1; then
    run sh -c 'ulimit -v 1500000; exec "$0" "$@"' "$OVOID" fit ../many.xyzr --part-atoms 500000 -o b.ovoid
    expect_code 6
    expect_err "a fit of 500000 atoms as a whole takes at least 1.6 GB of memory, and there are "
    expect_err "; fit it in parts (parts.atoms, --part-atoms)"
    run sh -c 'ulimit -v 1500000; exec "$0" "$@"' "$OVOID" fit ../many.xyzr --part-atoms 100000 --jobs 8 -o b.ovoid
    expect_code 6
    expect_err "a fit of 500000 atoms, 8 parts of up to 62500 of them at a time, takes at least 1.6 GB of memory"
    expect_err "or fewer at a time (parts.jobs, --jobs)"
    [ ! -e b.ovoid ] || fail "there should be no model"
fi
