#!/bin/sh
# manual.sh OVOID SOURCE FOLDER
# From the tool's help, its manual pages and bash completion: FOLDER/man1/*.1 and FOLDER/ovoid.bash.
# SOURCE is the folder of this script; what no help says is in SOURCE/../docs/ovoid.roff.
set -eu
ovoid=$1
source=$2
folder=$3
LC_ALL=C # text is bytes, in any awk
export LC_ALL
mkdir -p "$folder/man1"
version=$("$ovoid" --version | sed -n '1s/.* //p')
commands=$("$ovoid" help | awk '/^Commands:/ { on = 1; next } /^$/ { on = 0 } on && $1 != "help" { print $1 }')
[ -n "$commands" ] || { echo "$ovoid: no help" >&2; exit 1; }
pages=ovoid
for command in $commands; do
    pages="$pages ovoid-$command"
done

# page NAME SUMMARY [MORE]: a help from standard input.
page() {
    awk -f "$source/manpage.awk" -v name="$1" -v summary="$2" -v version="$version" \
        -v also="$(echo " $pages " | sed "s/ $1 / /")" -v more="${3:-}" >"$folder/man1/$1.1"
}

"$ovoid" help | page ovoid "a molecule's Gaussian surface as a few ellipsoids" "$source/../docs/ovoid.roff"
for command in $commands; do
    "$ovoid" help "$command" |
        page "ovoid-$command" "$("$ovoid" help | sed -n "s/^  $command  *//p")"
done
{
    "$ovoid" help
    for command in $commands; do "$ovoid" help "$command"; done
} | awk -f "$source/completion.awk" >"$folder/ovoid.bash"
cat "$source/completion.bash" >>"$folder/ovoid.bash"
