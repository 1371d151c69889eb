#!/bin/sh
# header.sh CC
# Each public header stands alone, in C99 and in C++.
set -u
cc=$1
check() {
    for header in include/ovoid/*.h; do
        name=ovoid/${header##*/}
        printf '#include <%s>\n#include <%s>\nint main(%s) { return 0; }\n' "$name" "$name" "$2" |
            $1 -pedantic -Wall -Wextra -Werror -fsyntax-only -Iinclude - || exit 1
    done
}
check "$cc -std=c99 -x c" void
for program in g++ c++ clang++ clang++-15 clang++-14; do
    if command -v "$program" >/dev/null; then
        check "$program -std=c++11 -x c++" ""
        exit 0
    fi
done
echo "skipped: there is no C++ compiler"
exit 77
