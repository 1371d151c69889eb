# Whether what a command printed is what a document says, line by line:
#   awk -f follow_compare.awk SAID PRINTED
# Words are to be the same. Numbers are where they do not depend on the device; counts of what was
# found and the measures of the original surface may differ a little; times and errors are not compared.

function fail(said, printed) {
    print "said:    " said
    print "printed: " printed
    failed = 1
}

# The line without its numbers, which go to number[1..count].
function take(line, number,   rest, words) {
    count = 0
    gsub(/ +/, " ", line) # columns of tables are as wide as their numbers
    rest = line
    while (match(rest, /[0-9]+(\.[0-9]+)?(e[-+]?[0-9]+)?/)) {
        number[++count] = substr(rest, RSTART, RLENGTH)
        words = words substr(rest, 1, RSTART - 1) "#"
        rest = substr(rest, RSTART + RLENGTH)
    }
    return words rest
}

# How far number i of a line that begins with `name` may be off, relative; -1 is any.
function slack(name, i) {
    if (name == "points")
        return i == 1 ? 0.02 : 0
    if (name == "area" || name == "volume")
        return i == 1 ? 0.002 : -1
    if (name == "model")
        return i <= 2 ? 0.2 : -1
    if (name == "mesh")
        return 0.02
    return name ~ /^(fit|goal|pieces|distance|deviation)$/ ? -1 : 0
}

FNR == NR {
    said[++lines] = $0
    next
}
FNR > lines {
    fail("(nothing)", $0)
    next
}
$1 == "device" || $1 == "time" {
    if (said[FNR] !~ "^" $1)
        fail(said[FNR], $0)
    next
}
{
    words = take(said[FNR], expected)
    if (words != take($0, found)) {
        fail(said[FNR], $0)
        next
    }
    table_row = /^[0-9]+[ ,]/ || / (done|failed \([0-9]+\)|goal not reached)$/
    for (i = 1; i <= count; i++) {
        off = found[i] - expected[i]
        most = table_row ? -1 : slack($1, i)
        if (most >= 0 && (off < 0 ? -off : off) > most * expected[i]) {
            fail(said[FNR], $0)
            next
        }
    }
}
END {
    if (NR - lines < lines)
        fail(lines " lines", NR - lines " lines")
    exit failed
}
