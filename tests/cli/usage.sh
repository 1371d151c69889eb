# Wrong options: exit code 2, an error that names the option, nothing written.
make_helix 6 a.xyzr

wrong() {
    text=$1
    shift
    run "$OVOID" "$@"
    expect_code 2
    expect_no_out
    expect_err "ovoid: error: "
    expect_err "$text"
    expect_files a.xyzr
}

wrong "no command 'fitt'; did you mean 'fit'?" fitt
wrong "did you mean 'devices'?" devcies
wrong "no command 'zzz' (" zzz
wrong "no command 'fi'" help fi
wrong "no option '--foo' before a command" --foo
wrong "which molecule?" fit
wrong "-o names the file of one model" fit a.xyzr b.xyzr -o c.ovoid
wrong "-o names the file of one model" fit a.xyzr -o c.ovoid --out-dir d
wrong "standard input has no name" fit a.xyzr -
wrong "standard input has no name" fit - --out-dir d
for option in trace owners; do
    wrong "--$option takes the ending of names in the folder, such as $option.csv for NAME.$option.csv" \
        fit a.xyzr b.xyzr --$option t/x.csv
    wrong "--$option takes the ending of names" fit a.xyzr --out-dir d --$option -
    wrong "--$option takes the ending of names" fit a.xyzr --out-dir d --$option ""
done
wrong "did you mean '--iterations'?" fit a.xyzr --iteratoins 3
wrong "no option '--zzzzzz' (" fit a.xyzr --zzzzzz
wrong "no option -x" fit a.xyzr -x
wrong "--decay needs a value" fit a.xyzr --decay
wrong "-o needs a value" fit a.xyzr -o
wrong "--quiet=yes: this option takes no value" fit a.xyzr --quiet=yes
wrong "'ovoid devices' takes no 'x'" devices x
wrong "no option '--jsn'; did you mean '--json'?" devices --jsn

for option in decay isovalue spacing padding tolerance ratio mesh-spacing epsilon max-error prune-below armijo shrink grow; do
    wrong "--$option takes a number, not 'x'" fit a.xyzr "--$option" x
    wrong "--$option takes a number, not ''" fit a.xyzr "--$option" ""
    wrong "--$option takes a number, not 'nan'" fit a.xyzr "--$option" nan
    wrong "--$option takes a number, not '0x1'" fit a.xyzr "--$option" 0x1
    wrong "--$option takes a number, not '1 '" fit a.xyzr "--$option" "1 "
    wrong "--$option is -1, but must be" fit a.xyzr "--$option" -1
    wrong "--$option is 1e999, but must be" fit a.xyzr "--$option" 1e999
done
for option in ellipsoids levels effort steps iterations sparse-iterations prune-every max-backtracks; do
    wrong "--$option takes a whole number, not 'x'" fit a.xyzr "--$option" x
    wrong "--$option takes a whole number, not '1.5'" fit a.xyzr "--$option" 1.5
    wrong "--$option is -1, but must be at least" fit a.xyzr "--$option" -1
    wrong "--$option is 9999999999, but must be at most" fit a.xyzr "--$option" 9999999999
done
wrong "--decay is 0, but must be above 0 Å⁻²" fit a.xyzr --decay 0
wrong "--armijo is 1, but must be at most 0.999" fit a.xyzr --armijo 1
wrong "--grow is 0.5, but must be at least 1" fit a.xyzr --grow 0.5
wrong "--iterations is 0, but must be at least 1" fit a.xyzr --method l1 --iterations 0
wrong "--sparse-iterations is 20, but there are only 10" fit a.xyzr --method l1 --iterations 10 \
    --sparse-iterations 20
wrong "--method takes adaptive or l1, not 'best'" fit a.xyzr --method best
wrong "--kernel takes ellipsoid or sphere, not 'cube'" fit a.xyzr --kernel cube
wrong "--first-step takes secant or grow, not 'best'" fit a.xyzr --first-step best
wrong "--format takes pdb, mmcif, pqr or xyzr, not 'mol2'" fit a.xyzr --format mol2
wrong "--spacing is 0, but must be above 0 Å" fit a.xyzr --spacing 0
wrong "--tolerance is 0, but must be above 0 Å" fit a.xyzr --tolerance 0
wrong "--ellipsoids is 0, but must be at least 1" fit a.xyzr --ellipsoids 0
wrong "--ratio is 1.5, but must be at most 1" fit a.xyzr --ratio 1.5
wrong "--effort is 11, but must be at most 10" fit a.xyzr --effort 11
wrong "--levels is 0, but must be at least 1" fit a.xyzr --levels 0
wrong "--levels is 33, but must be at most 32" fit a.xyzr --levels 33

# One goal, and no options of the other method, which would do nothing.
wrong "--tolerance and --ellipsoids are both goals" fit a.xyzr --tolerance 1 --ellipsoids 3
wrong "--ratio and --tolerance are both goals" fit a.xyzr --ratio 0.5 --tolerance 1
wrong "--ellipsoids and --ratio are both goals" fit a.xyzr --ellipsoids 3 --ratio 0.5
for option in tolerance ellipsoids ratio levels effort steps; do
    wrong "--$option is an option of method adaptive, and the method is l1" fit a.xyzr \
        "--$option" 1 --method l1
done
for option in iterations sparse-iterations epsilon max-error prune-below prune-every armijo shrink \
    grow max-backtracks kernel first-step; do
    case $option in
    kernel) value=sphere ;;
    first-step) value=grow ;;
    armijo | shrink) value=0.5 ;;
    *) value=1 ;;
    esac
    wrong "--$option is an option of method l1, and the method is adaptive: add --method l1" \
        fit a.xyzr "--$option" $value
    wrong "--$option is an option of method l1" fit a.xyzr --method adaptive "--$option" $value
done

# Outputs that would fall on each other or on the input.
wrong "the molecule and the model (-o) are the same file" fit a.xyzr -o a.xyzr
wrong "the molecule and the report (--report) are the same file" fit a.xyzr --report ./a.xyzr
wrong "the report (--report) and the trace (--trace) are the same file" fit a.xyzr --report x \
    --trace ../work/x
wrong "cannot both go to standard output" fit a.xyzr -o - --trace -
wrong "cannot both go to standard output" fit a.xyzr --trace - --owners -
wrong "the molecule and the owners (--owners) are the same file" fit a.xyzr --owners a.xyzr
wrong "name the model's file with -o" fit -
wrong "standard output cannot take" fit a.xyzr --levels 2 -o -
wrong "'/dev/null' is no regular file" fit a.xyzr --levels 2 -o /dev/null
wrong "several tables of owners, which standard output cannot take" fit a.xyzr --levels 2 --owners -
wrong "the trace (--trace) and the owners of level 2 are the same file" fit a.xyzr --levels 2 \
    --owners o.csv --trace o.level2.csv
wrong "the report (--report) and the model of level 2 are the same file" fit a.xyzr --levels 2 \
    --report a.level2.ovoid
wrong "the trace (--trace) and the model of level 3 are the same file" fit a.xyzr --levels 3 -o x.y \
    --trace ./x.level3.y
wrong "the molecule and the model of level 2 are the same file" fit a.level2.xyzr -o a.xyzr \
    --levels 2
ln a.xyzr b.xyzr
run "$OVOID" fit a.xyzr -o b.xyzr
expect_code 2
expect_err "are the same file"
