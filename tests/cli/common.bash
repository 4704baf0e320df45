# What the command-line tests share: a folder of their own, and ways to show what a run does.
set -u
export LC_ALL=C
umbrage=$UMBRAGE_PROGRAM
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

# Run and show the words, the exit code and standard error. Standard output is kept in ./out.
run() {
    local code=0
    "$umbrage" "$@" >out 2>err || code=$?
    printf '%s\n' "umbrage $* -> $code"
    sed 's/^/  /' err
}

# The same for failures whose words belong to others: the exit code, and whether standard output is empty
# and standard error has one to three lines.
refused() {
    local code=0 lines
    "$umbrage" "$@" >out 2>err || code=$?
    lines=$(wc -l <err)
    [ ! -s out ] || printf '%s\n' "umbrage $*: prints to standard output"
    [ "$lines" -ge 1 ] && [ "$lines" -le 3 ] || printf '%s\n' "umbrage $*: $lines lines on standard error"
    printf '%s\n' "umbrage $* -> $code"
}

# Text without what differs from run to run.
steady() {
    sed -E 's/"(time_ms|median_ms|p99_ms|load_ms|build_ms)":[^,}]*/"\1":0/g'
}

# same NAME FILE FILE
same() {
    if cmp -s "$2" "$3"; then
        echo "$1: the same"
    else
        echo "$1: different"
        diff "$2" "$3" | cut -c 1-400 | head -n 6
    fi
}
