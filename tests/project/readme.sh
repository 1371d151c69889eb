#!/bin/sh
# readme.sh OVOID
# What README.md says is so: CI runs its test line, its example is the program that is tested, its
# workflows exist; and docs/reference.md names every option of the tool with its default.
set -u
ovoid=$1
reference=docs/reference.md
status=0
fail() {
    echo "README.md or docs/reference.md: $*"
    status=1
}
# The fenced block under a marker.
block() {
    sed -n "/^<!-- $1 -->\$/,\$p" README.md | sed -n '/^```/,/^```$/p' | sed '1d' | sed '/^```$/,$d'
}

for name in demo test; do
    [ "$(block "$name line" | wc -l)" -eq 1 ] || fail "the $name line is not one line"
    block "$name line" | grep -q -- "cmake --workflow --preset $name\\>" ||
        fail "the $name line does not run the workflow $name"
done
[ "$(.ci/run --print)" = "$(block 'test line')" ] || fail ".ci/run runs another line"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
block consumer.c >"$work/consumer.c"
diff "$work/consumer.c" tests/consumer/consumer.c || fail "the example is not consumer.c"

for preset in $(grep -o -- '--workflow --preset [a-z]*' README.md CONTRIBUTING.md |
    sed 's/.* //' | sort -u); do
    cmake --workflow --list-presets | grep -q "\"$preset\"" || fail "there is no workflow $preset"
done

{ "$ovoid" help; "$ovoid" help fit; "$ovoid" help devices; } |
    grep -o -- '--[a-z][a-z0-9-]*' | sort -u >"$work/options"
[ -s "$work/options" ] || fail "the tool's help names no option"
while read -r option; do
    grep -q -- "$option\\>" "$reference" || fail "$option is missing"
done <"$work/options"

# "--name X   words (default V unit)", over one or more lines, against "| `--name X` | V |".
"$ovoid" help fit | tr '\n' ' ' | sed 's/ --/\n--/g' |
    sed -n 's/^\(--[a-z0-9-]* [A-Z]*\) .*(default \([0-9][^ )]*\).*/\1=\2/p' >"$work/defaults"
[ -s "$work/defaults" ] || fail "the tool's help gives no default"
while IFS='=' read -r option default; do
    grep -qF -- "\`$option\` | $default |" "$reference" || fail "the default of $option is $default"
done <"$work/defaults"
exit "$status"
