# Turns all helps, one after the other, into what bash has to know to complete a command line:
#   { ovoid help; ovoid help fit; ...; } | awk -f completion.awk
# and puts it before completion.bash. How a help is made is said in manpage.awk. The name of an option
# says what it takes: --x nothing, --x a|b|FILE one of the words a and b or a file, --x N something
# that cannot be guessed. The words may be entries of its meaning instead, as those of --view.

# The endings in a text: 'ply obj' in 'a name ends in .ply or .obj'.
function endings(text,   found, ending) {
    while (match(text, /\.([a-z]|3m)[a-z0-9]*/)) {
        ending = substr(text, RSTART + 1, RLENGTH - 1)
        if (index(found " ", " " ending " ") == 0)
            found = found " " ending
        text = substr(text, RSTART + RLENGTH)
    }
    return substr(found, 2)
}

# The files that an option takes: their endings, or '*'.
function files_of(   found) {
    if (option ~ /--output/) {
        if (match(usage, /FILE\.[a-z]+/))
            found = substr(usage, RSTART, RLENGTH)
        found = endings(found " " meaning " " listed)
    }
    return found == "" ? "*" : found
}

function end_option(   count, parts, i, words, files, folders) {
    if (option == "")
        return
    if (value == "SELECTOR")
        value = "cpu|gpu|accelerator"
    count = split(value, parts, "|")
    for (i = 1; i <= count; i++)
        if (parts[i] ~ /^[a-z0-9]/)
            words = words " " parts[i]
        else if (parts[i] == "FILE")
            files = files_of()
        else if (parts[i] == "DIR")
            folders = 1
    words = substr(words inner, 2)
    count = split(option, parts, ", ")
    for (i = 1; i <= count; i++) {
        options = options " " parts[i]
        if (words files folders != "") {
            values = values (i > 1 ? " | " : "    ") "'" command " " parts[i] "'"
        } else if (value != "")
            others = others parts[i] " "
    }
    if (words files folders != "")
        values = values ") words='" words "' files='" files "' folders='" folders "' ;;\n"
    option = value = meaning = inner = ""
}

function end_command(   inputs) {
    end_option()
    if (command == "")
        return
    inputs = usage ~ /MOLECULE|INPUT/ ? " molecule" : ""
    inputs = inputs (usage ~ /MODEL|INPUT/ ? " model" : "")
    commands = commands "    " command ")\n        options='" substr(options, 2) "'\n        others=' " \
        others "' inputs='" substr(inputs, 2) "' ;;\n"
}

/^Usage: / {
    end_command()
    command = $3 ~ /^[a-z]/ ? $3 : ""
    usage = listed = options = others = ""
}
/^Usage: /, /^$/ {
    usage = usage " " $0
}
/^[^ ]/ {
    end_option()
}
/^  -/ {
    end_option()
    match($0, /^  ((-[a-z], )?--[a-z0-9-]+)/)
    option = substr($0, 3, RLENGTH - 2)
    rest = substr($0, RLENGTH + 1)
    value = meaning = ""
    if (rest ~ /^ [^ ]/) {
        match(rest, /^ [^ ]+/)
        value = substr(rest, 2, RLENGTH - 1)
        rest = substr(rest, RLENGTH + 1)
    }
    $0 = "   " rest
}
/^  \./ { # what the ending of a file's name says
    listed = listed " " $0
}
option != "" && /^   / {
    meaning = meaning " " $0
    if (match($0, /^ +[a-z]+   *[^ ]/))
        inner = inner " " $1
}
command == "" && /^  [a-z]+  / && commands_listed {
    names = names " " $1
}
/^[A-Z].*:$/ {
    commands_listed = $0 == "Commands:"
}

END {
    end_command()
    print "# bash completion for ovoid. Made from the tool's help."
    print ""
    print "_ovoid_commands='" substr(names, 2) "'"
    print ""
    print "# The options of command $1, those that take what cannot be guessed, and what it reads."
    print "_ovoid_command() {"
    print "    options= others= inputs="
    print "    case $1 in"
    printf "%s", commands
    print "    esac"
    print "}"
    print ""
    print "# What option $2 of command $1 takes: words, files with these endings ('*': any), folders."
    print "_ovoid_option() {"
    print "    words= files= folders="
    print "    case \"$1 $2\" in"
    printf "%s", values
    print "    esac"
    print "}"
    print ""
}
