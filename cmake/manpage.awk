# Turns what `ovoid help COMMAND` prints into a manual page:
#   ovoid help fit | awk -f manpage.awk -v name=ovoid-fit -v summary=TEXT -v version=0.1.0 \
#       -v also='ovoid ovoid-mesh' [-v more=FILE]
# `more` holds sections that no help has; `also` names the pages to see also.
#
# A help has lines of usage, paragraphs, and sections: a line that ends in ':', and under it indented
# entries. An entry is a name, two or more spaces, and its meaning, which the next lines go on with if
# they begin further right than the name. An entry in a meaning is an entry again.

# Text as roff takes it: no line of it is a request, and dashes and quotes are those of a terminal.
function escape(text) {
    gsub(/\\/, "\\e", text)
    gsub(/-/, "\\-", text)
    gsub(/'/, "\\(aq", text)
    gsub(/`/, "\\(ga", text)
    gsub(/\^/, "\\(ha", text)
    gsub(/~/, "\\(ti", text)
    return text ~ /^\./ ? "\\&" text : text
}

function prose(text) {
    text = escape(text)
    gsub(/\\-\\-[a-z][a-z0-9\\-]*/, "\\fB&\\fR", text) # options
    return text
}

# What is to be typed is bold, what stands for something in capitals.
function typed(text) {
    text = escape(text)
    gsub(/[A-Z][A-Z]+/, "\\fI&\\fB", text)
    return "\\fB" text "\\fR"
}

function leave() {
    if (--depth > 0) {
        print ".RE"
        resumed = 1
    }
}

# A line of a section that begins behind `column` spaces. at[] is the column of the names of each
# level of entries that it may be in.
function line(column, text,   gap) {
    while (depth > 0 && column <= at[depth])
        leave()
    gap = match(text, /   *[^ ]/)
    if (depth > 0 && !gap) {
        if (resumed) # after entries within the meaning
            print ".IP"
        resumed = 0
        print prose(text)
        return
    }
    if (depth > 0)
        print ".RS"
    resumed = 0
    at[++depth] = column
    print ".TP"
    print typed(gap ? substr(text, 1, gap - 1) : text)
    if (gap)
        line(column + gap + RLENGTH - 2, substr(text, gap + RLENGTH - 1))
}

function section(title, first) {
    while (depth > 0)
        leave()
    if (title in chapters)
        print ".SH " chapters[title]
    else if (first ~ /^-/ && !options++)
        print ".SH OPTIONS"
    if (!(title in chapters) && title != "Options")
        print ".SS " escape(title)
}

function paragraph(text) {
    while (depth > 0)
        leave()
    if (blank)
        print ".PP"
    print prose(text)
}

BEGIN {
    chapters["Commands"] = "COMMANDS"
    chapters["Columns"] = "COLUMNS"
    chapters["Examples"] = "EXAMPLES"
    chapters["Environment"] = "ENVIRONMENT"
    chapters["Exit codes"] = "EXIT STATUS"
    print "'\\\" -*- coding: UTF-8 -*-"
    print ".TH " escape(toupper(name)) " 1 \"\" \"Ovoid " version "\" \"Ovoid manual\""
    print ".nh" # words are not torn apart
    print ".ad l"
    print ".SH NAME"
    print escape(name) " \\- " escape(summary)
    print ".SH SYNOPSIS"
}

/^Usage: / || (usage && /^ /) {
    if (usage++)
        print ".br"
    sub(/^(Usage:)? */, "")
    print typed($0)
    next
}
usage {
    print ".SH DESCRIPTION"
    usage = 0
    next
}
/^$/ {
    blank = 1
    next
}
heading != "" {
    match($0, /^ */)
    section(heading, substr($0, RLENGTH + 1))
    heading = ""
}
/^[^ ].*:$/ && blank {
    heading = substr($0, 1, length($0) - 1)
    next
}
{
    match($0, /^ */)
    if (RLENGTH)
        line(RLENGTH, substr($0, RLENGTH + 1))
    else
        paragraph($0)
    blank = 0
}

END {
    while (depth > 0)
        leave()
    while (more && (getline text < more) > 0)
        print text
    print ".SH SEE ALSO"
    count = split(also, pages, " ")
    for (i = 1; i <= count; i++)
        print ".BR " escape(pages[i]) " (1)" (i < count ? "," : "")
}
