# Files that $1 may become whose names end in one of the rest, also compressed where "gz" is one of
# them; all files for '*'.
_ovoid_files() {
    local start=$1 file ending
    shift
    compopt -o filenames 2>/dev/null # fails outside of a completion, as in a test
    while IFS= read -r file; do
        for ending in "$@"; do
            if [[ -d $file || $ending == '*' || ${file##*/} == ?*".$ending" ]]; then
                COMPREPLY+=("$file")
                break
            fi
        done
    done < <(compgen -f -- "$start")
}

# $1 with each of the other words as its ending.
_ovoid_endings() {
    local stem=${1%.*} start=$1 ending
    shift
    for ending in "$@"; do
        [[ $ending == '*' || "$stem.$ending" != "$start"* ]] || COMPREPLY+=("$stem.$ending")
    done
}

_ovoid_value() {
    local current=$1
    COMPREPLY=($(compgen -W "$words" -- "$current"))
    set -f # '*' is no pattern here
    [[ -z $files ]] || _ovoid_files "$current" $files
    [[ $current != *.* || ${#COMPREPLY[@]} -gt 0 ]] || _ovoid_endings "$current" $files
    set +f
    [[ -z $folders ]] || _ovoid_files "$current" / # which no file ends in
}

_ovoid_inputs() {
    local endings=
    [[ $inputs != *molecule* ]] ||
        endings='pdb ent cif mmcif pqr xyzr pdb.gz ent.gz cif.gz mmcif.gz pqr.gz xyzr.gz'
    [[ $inputs != *model* ]] || endings+=' ovoid'
    [[ -z $endings ]] || _ovoid_files "$1" $endings
}

_ovoid() {
    local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]}
    local command=${COMP_WORDS[1]} options others inputs words files folders
    COMPREPLY=()
    if ((COMP_CWORD == 1)); then
        COMPREPLY=($(compgen -W "$_ovoid_commands --help --version" -- "$current"))
        return
    fi
    if [[ $command == help ]]; then
        ((COMP_CWORD > 2)) || COMPREPLY=($(compgen -W "$_ovoid_commands" -- "$current"))
        return
    fi
    if [[ $current == = ]]; then # bash makes three words of --option=value
        current=
    elif [[ $previous == = ]]; then
        previous=${COMP_WORDS[COMP_CWORD - 2]}
    fi
    _ovoid_command "$command"
    _ovoid_option "$command" "$previous"
    if [[ $words$files$folders ]]; then
        _ovoid_value "$current"
    elif [[ $others == *" $previous "* ]]; then
        return
    elif [[ $current == -* ]]; then
        COMPREPLY=($(compgen -W "$options" -- "$current"))
    else
        _ovoid_inputs "$current"
    fi
}
complete -F _ovoid ovoid
