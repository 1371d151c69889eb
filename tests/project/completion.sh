#!/bin/sh
# completion.sh OVOID SCRIPT
# What bash offers to complete with SCRIPT: what the help names, the tool takes, and the folder holds.
set -u
command -v bash >/dev/null || { echo "skipped: bash is not installed"; exit 77; }
ovoid=$(realpath "$1")
script=$(realpath "$2")
input=$(realpath host/cli/input.c)
exec bash -s "$ovoid" "$script" "$input" <<'BASH'
ovoid=$1 script=$2 input=$3 status=0
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
. "$script" || exit 1
[[ $(complete -p ovoid) == 'complete -F _ovoid ovoid' ]] || { echo "nothing completes ovoid"; exit 1; }

# offered WORD...: what is offered for the last one, sorted, on one line.
offered() {
    COMP_WORDS=(ovoid "$@") COMP_CWORD=$# COMPREPLY=()
    _ovoid
    ((${#COMPREPLY[@]} == 0)) || printf '%s\n' "${COMPREPLY[@]}" | sort | paste -sd '|'
}
# expect RESULT WORD...
expect() {
    local result=$1 found
    shift
    found=$(offered "$@")
    [[ $found == "$result" ]] || { echo "ovoid $*: '$result' was expected, '$found' is offered"; status=1; }
}

mapfile -t commands < <("$ovoid" help | sed -n '/^Commands:/,/^$/s/^  \([a-z]*\) .*/\1/p')
((${#commands[@]} > 6)) || { echo "the help has too few commands"; status=1; }
expect "$(printf '%s\n' --help --version "${commands[@]}" | sort | paste -sd '|')" ''
expect "$(printf '%s\n' "${commands[@]}" | sort | paste -sd '|')" help ''
expect 'measure|mesh' me
expect 'measure|mesh' help me
expect '' help fit ''
expect '' nonsense -

# All options, and of those with a choice the names that the tool takes: no more, no fewer.
chosen=0
for command in "${commands[@]}"; do
    [[ $command != help ]] || continue
    expect "$("$ovoid" help "$command" | grep -oE '^  -[^ ]+( --[a-z-]+)?' | grep -oE -- '-[^ ,]+' |
        sort | paste -sd '|')" "$command" -
    for option in $("$ovoid" help "$command" | grep -oE '^  (-., )?--[a-z-]+ [^ ]' | grep -oE -- '--[a-z-]+'); do
        IFS='|' read -ra words <<<"$(offered "$command" "$option" '')"
        case $option in
        --device) [[ ${words[*]} == 'accelerator cpu gpu' ]] || { echo "$option: ${words[*]}"; status=1; } ;;
        *)
            for word in "${words[@]}"; do
                "$ovoid" "$command" "$option" "$word" --help >/dev/null 2>&1 ||
                    { echo "ovoid $command $option $word: offered, but not taken"; status=1; }
            done
            # "--method takes adaptive or l1, not '?'"
            names=$("$ovoid" "$command" "$option" '?' 2>&1 |
                sed -n "s/.*$option takes \([a-z0-9, ]*\), not '?'.*/\1/p")
            [[ -n $names && $names != a*number && $names != six* ]] || continue
            chosen=$((chosen + 1))
            names=${names// or /, }
            expect "$(printf '%s\n' ${names//,/ } | sort | paste -sd '|')" "$command" "$option" '' ;;
        esac
    done
done
((chosen >= 12)) || { echo "only $chosen options have a choice"; status=1; }
expect 'adaptive' fit a.pdb --method ad
expect 'adaptive|l1' fit --method = ''
expect 'l1' fit --method = l
expect 'adaptive|l1' fit --method =

# Files: those that can be read, and folders.
mkdir folder
touch a.pdb b.cif.gz c.ovoid d.txt e.ply f.png 'g h.pqr' .pdb
expect 'a.pdb|b.cif.gz|folder|g h.pqr' fit ''
expect 'a.pdb|b.cif.gz|c.ovoid|folder|g h.pqr' mesh --quiet ''
expect 'a.pdb|b.cif.gz|c.ovoid|folder|g h.pqr' measure a.pdb ''
expect 'g h.pqr' fit g
expect '' devices ''
expect '' fit --decay ''
expect 'a.pdb' fit --radii a
expect 'paper' fit --radii pa
expect 'c.ovoid|folder' fit -o ''
expect 'e.ply|folder' mesh -o ''
expect 'e.ply' mesh -o e
expect 'n.glb|n.obj|n.off|n.ply|n.stl' mesh -o n.
expect 'n.obj|n.off' mesh --output n.o
expect 'n.png' render a.pdb -o n.
expect 'n.ccp4|n.cif|n.cxc' export -o n.c
endings=$(sed -n 's/.*molecules\[\] = {\(.*\)};.*/\1/p' "$input" | tr -d '",.')
[[ -n $endings ]] || { echo "$input: where are the endings of molecules?"; status=1; }
for ending in $endings; do
    touch "m.$ending" "z.$ending.gz"
    expect "m.$ending" fit "m.$ending"
    expect "z.$ending.gz" fit "z.$ending"
done
exit "$status"
BASH
