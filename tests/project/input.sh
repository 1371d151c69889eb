#!/bin/sh
# input.sh FOLDER [VARIABLE]
# Skips where a folder of molecules is absent; VARIABLE names another one in the environment.
folder=$1
[ -z "${2:-}" ] || eval "folder=\${$2:-\$folder}"
if [ ! -d "$folder" ]; then
    echo "skipped: there is no $folder, so tests that need it skip, in part or as a whole"
    exit 77
fi
echo "$folder: $(find "$folder" -type f | wc -l) files"
