#!/bin/sh
# symbols.sh LIBRARY TOOL
# The library exports what the public headers declare and nothing else, and the tool stands on the
# library alone.
set -eu
library=$1
tool=$2
exported=$(nm -D --defined-only "$library" | awk '{print $3}' | sed 's/@.*//' | sort)
declared=$(cat include/ovoid/*.h | grep -v '^#' | tr '\n' ' ' | grep -o 'OVOID_API [^;(]*(' |
    sed 's/[ (]*$//; s/.*[ *]//' | sort)
if [ "$exported" != "$declared" ]; then
    echo "Exported ('>') and declared ('<') functions differ:"
    work=$(mktemp -d)
    trap 'rm -rf "$work"' EXIT
    echo "$declared" >"$work/declared"
    echo "$exported" >"$work/exported"
    diff "$work/declared" "$work/exported" || exit 1
fi
echo "$(echo "$exported" | wc -l) functions, all of them declared"

needed=$(readelf -d "$tool" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p')
echo "The tool needs:" $needed
echo "$needed" | grep -q '^libovoid\.so' || { echo "The tool does not use libovoid."; exit 1; }
if echo "$needed" | grep -q OpenCL; then
    echo "The tool uses OpenCL past the library."
    exit 1
fi
