# Pictures: views, where they go, and what is refused before any work.
need_device
make_helix 6 a.xyzr
run "$OVOID" fit a.xyzr --method l1 --iterations 40 -q
expect_code 0
small="--size 40x30 --samples 1"

# The eight bytes that a PNG file begins with, and its size in the header.
expect_png() {
    [ "$(od -An -tx1 -N8 "$1" | tr -d ' \n')" = 89504e470d0a1a0a ] || fail "$1 should be a PNG file"
    [ "$(od -An -tu1 -j18 -N2 "$1" | tr -s ' ')" = " $(($2 / 256)) $(($2 % 256))" ] ||
        fail "$1 should be $2 pixels wide"
}

# Defaults by what is given, and every view.
run "$OVOID" render a.xyzr $small -o a.png
expect_code 0
expect_silent
expect_out "molecule  a.xyzr: 6 atoms"
expect_out "picture   original, 40 x 30 pixels, written to a.png"
expect_png a.png 40
run "$OVOID" render a.ovoid $small -o a.png
expect_code 0
expect_out "picture   model, 40 x 30"
run "$OVOID" render a.xyzr a.ovoid $small -o b.png
expect_code 0
expect_out "picture   overlay"
for view in original model overlay difference ellipsoids panel; do
    run "$OVOID" render a.xyzr a.ovoid $small --view $view -o $view.png
    expect_code 0
    expect_out "picture   $view"
    expect_png $view.png 40
    case $view in difference) expect_out "colours   -" ;; esac
done
cmp -s original.png model.png && fail "views should differ"
cmp -s b.png overlay.png || fail "the same picture should have the same bytes"
run "$OVOID" render a.xyzr a.ovoid $small --panel --quiet -o again.png
expect_code 0
expect_silent
expect_no_out
cmp -s again.png panel.png || fail "--panel should be --view panel"

# Each option changes the picture.
for option in "--rotate 0,90,0" "--direction 1,0,0" "--isovalue 0.5" "--colour ff0000" \
    "--background black" "--background transparent" "--across 60" "--centre 0,0,0" "--decay 0.8" \
    "--samples 2"; do
    run "$OVOID" render a.xyzr $small $option -o other.png
    expect_code 0
    cmp -s other.png original.png && fail "$option should change the picture"
done
run "$OVOID" render a.xyzr a.ovoid $small --view model --no-centres -o other.png
expect_code 0
cmp -s other.png model.png && fail "--no-centres should change the picture"

# Colours by where things are.
run "$OVOID" render a.xyzr $small --colour-by radius -o other.png
expect_code 0
expect_out " Å from the middle, blue, to "
cmp -s other.png original.png && fail "--colour-by radius should change the picture"
run "$OVOID" render a.ovoid $small --view ellipsoids --colour-by unit -o other.png
expect_code 0
run "$OVOID" render a.xyzr a.ovoid $small --colour-by radius -o c.png
expect_code 2
expect_err "--colour-by radius is for the views original, model and ellipsoids, not 'overlay'"
run "$OVOID" render a.ovoid $small --colour-by unit -o c.png
expect_code 2
expect_err "--colour-by unit is for the view ellipsoids, not 'model'"
run "$OVOID" render a.ovoid $small --colour-by chain -o c.png
expect_code 2
expect_err "--colour-by takes radius, unit or none, not 'chain'"

# To standard output, the summary apart.
run "$OVOID" render a.xyzr $small -o -
expect_code 0
expect_err "written to standard output"
cmp -s "$out" original.png || fail "the picture should be on standard output"
"$OVOID" render - $small -q -o stdin.png <a.xyzr >"$out" 2>"$err"
code=$?
expect_code 0
cmp -s stdin.png original.png || fail "a molecule from standard input should look the same"

# No surface is a warning.
run "$OVOID" render a.xyzr $small --isovalue 1e6 -o none.png
expect_code 0
expect_err "ovoid: warning: there is no surface in the picture"
expect_png none.png 40

# Refused before the work.
rm ./*.png
refused() {
    text=$1
    shift
    run "$OVOID" render "$@"
    expect_code 2
    expect_no_out
    expect_err "$text"
    expect_files a.xyzr a.ovoid
}
refused "a picture of what?"
refused "Name a PNG file with -o" a.xyzr
refused "but 'c' follows" a.xyzr a.ovoid c -o x.png
refused "view 'model' needs a model" a.xyzr --view model -o x.png
refused "view 'overlay' needs a molecule" a.ovoid --view overlay -o x.png
refused "did you mean 'difference'" a.xyzr --view diference -o x.png
refused "--size takes WIDTHxHEIGHT" a.xyzr --size 40 -o x.png
refused "--size takes WIDTHxHEIGHT" a.xyzr --size 0x40 -o x.png
refused "--size takes WIDTHxHEIGHT" a.xyzr --size 40x99999999999999999999 -o x.png
refused "three numbers X,Y,Z" a.xyzr --direction 1,2 -o x.png
refused "three numbers X,Y,Z" a.xyzr --rotate 1,2,nan -o x.png
refused "points nowhere" a.xyzr --direction 0,0,0 -o x.png
refused "not 'ff00'" a.xyzr --colour ff00 -o x.png
refused "not 'transparent'" a.xyzr --colour transparent -o x.png
refused "--samples is 9" a.xyzr --samples 9 -o x.png
refused "did you mean '--isovalue'" a.xyzr --isovolue 1 -o x.png
refused "are the same file" a.xyzr -o a.xyzr
refused "cannot both come from standard input" - - -o x.png

# Inputs and outputs that fail.
run "$OVOID" render no.xyzr -o x.png
expect_code 3
run "$OVOID" render a.xyzr -o no/x.png
expect_code 4
expect_err "there is no folder 'no'"
if [ -w /dev/full ]; then
    run "$OVOID" render a.xyzr $small -o /dev/full
    expect_code 4
    expect_err "No space left on device"
fi
expect_files a.xyzr a.ovoid
