#!/bin/sh
# Runs the demo and puts what it prints, the list of devices, and the example program into README.md.
# For a change that alters any of them.
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
sed -n '/^The file is /,$p' "$work/log" >"$work/demo"
build/demo/ovoid devices >"$work/devices"
replace 'demo output' "$work/demo"
replace 'devices output' "$work/devices"
replace 'consumer.c' tests/consumer/consumer.c
