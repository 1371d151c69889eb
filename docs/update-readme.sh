#!/bin/sh
# Puts the list of devices, the example program, and what the commands of README.md and docs/guide.md
# print into them. For a change that alters any of these.
set -eu
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# replace MARKER FILE: the fenced block under <!-- MARKER --> becomes the text of FILE.
replace() {
    awk -v marker="<!-- $1 -->" -v file="$2" '
        $0 == marker { marked = 1 }
        /^```/ && marked {
            print
            if (inside) { marked = inside = 0; next }
            inside = 1
            while ((getline line < file) > 0) print line
            next
        }
        !inside { print }' README.md >"$work/README.md"
    cat "$work/README.md" >README.md
}

cmake --workflow --preset demo >"$work/log" || { cat "$work/log"; exit 1; }
build/demo/ovoid devices >"$work/devices"
replace 'devices output' "$work/devices"
replace 'consumer.c' tests/consumer/consumer.c
sh docs/follow.sh --update build/demo/ovoid README.md
sh docs/follow.sh --update build/demo/ovoid docs/guide.md
