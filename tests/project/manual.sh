#!/bin/sh
# manual.sh OVOID FOLDER
# The manual pages in FOLDER/man1 say all that the tool's help says, and groff has nothing to complain
# of. Without groff the first is not known, and the test is skipped.
set -u
ovoid=$1
pages=$2/man1
status=0
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() {
    echo "$*"
    status=1
}

commands=$("$ovoid" help | sed -n '/^Commands:/,/^$/s/^  \([a-z]*\) .*/\1/p' | grep -v '^help$')
[ "$(echo "$commands" | wc -l)" -ge 6 ] || fail "the help names too few commands: $commands"
for command in '' $commands; do
    page=$pages/ovoid${command:+-$command}.1
    [ -s "$page" ] || { fail "$page is missing"; continue; }
    # Each entry of an option is one of the page: .TP, and its name in the next line.
    "$ovoid" help $command | sed -n 's/^  \(-[^ ]*\(, --[a-z-]*\)\{0,1\}\).*/\1/p' >"$work/options"
    [ -s "$work/options" ] || fail "the help of '$command' has no options"
    sed -n '/^\.TP$/{n;s/\\f.//g;s/\\-/-/g;p;}' "$page" >"$work/names"
    while IFS= read -r option; do
        grep -qE -- "^$option( |\$)" "$work/names" || fail "$page: no entry $option"
    done <"$work/options"
    for line in '^\.SH NAME$' '^ovoid.* \\- .*[a-z]' '^\.SH SYNOPSIS$' '^\.SH DESCRIPTION$' \
        '^\.SH EXIT STATUS$' '^\.SH SEE ALSO$' '^\.SH ENVIRONMENT$'; do
        grep -q -- "$line" "$page" || fail "$page: no line $line"
    done
done
[ "$(find "$pages" -type f | wc -l)" -eq $(($(echo "$commands" | wc -l) + 1)) ] ||
    fail "there are other pages than those of the commands"

if ! command -v groff >/dev/null; then
    [ "$status" -eq 0 ] || exit "$status"
    echo "skipped: groff is not installed (Debian: groff-base)"
    exit 77
fi
# Every word of the help is there, in the same order.
for command in '' $commands; do
    page=$pages/ovoid${command:+-$command}.1
    groff -K utf8 -man -Tutf8 -P-cbou -rLL=2000n -ww "$page" >"$work/text" 2>"$work/warnings"
    [ ! -s "$work/warnings" ] || fail "$page: groff says: $(cat "$work/warnings")"
    "$ovoid" help $command | sed 's/^Usage: //; /^Options:$/d; s/^Exit codes:$/Exit status/; /^[A-Z].*:$/s/:$//' |
        awk -v text="$work/text" '
            BEGIN { while ((getline line < text) > 0) page = page " " tolower(line); count = split(page, words, " ") }
            { for (i = 1; i <= NF; i++) {
                while (++at <= count && words[at] != tolower($i));
                if (at > count) { print "\"" $i "\" of this line is missing: " $0; exit 1 } } }' >"$work/missing" ||
        fail "$page: $(cat "$work/missing")"
done
exit "$status"
