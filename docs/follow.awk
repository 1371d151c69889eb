# Takes a document apart for follow.sh: its blocks go to FOLDER/001.sh, 001.out, 002.sh and so on,
# with what they need in 001.need.
#   awk -f follow.awk -v folder=FOLDER DOCUMENT
function name(kind) {
    return sprintf("%s/%03d.%s", folder, count, kind)
}
/^<!-- run[a-z ]* -->$/ {
    kind = "sh"
    count++
    for (i = 3; i < NF; i++)
        print $i >name("need")
    next
}
/^<!-- prints -->$/ {
    kind = "out"
    next
}
kind != "" && /^```/ {
    if (inside++) {
        kind = ""
        inside = 0
    } else
        printf "" >name(kind)
    next
}
inside {
    print >name(kind)
}
