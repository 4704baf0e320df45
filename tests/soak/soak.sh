#!/bin/bash
# The soak program itself: the short plan finds nothing wrong; interrupted, it is taken up again and
# comes to the same figures, with another number of threads; planted mistakes are found (exit code 1).
#   soak.sh PROGRAM
set -u -o pipefail
soak=$1
scale=1
[ "${UMBRAGE_TEST_SIZE:-}" = small ] && scale=0.25
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir "$folder"/{a,b,c,d}

# run FOLDER EXPECTED-CODE OPTION...: prints the table without its columns of time
run() {
    local out=$folder/$1 expected=$2 code
    shift 2
    "$soak" --short --scale "$scale" --out "$out" "$@" 2>"$out/notes" | cut -d '|' -f 1-12
    code=${PIPESTATUS[0]}
    if [ "$code" != "$expected" ]; then
        cat "$out/notes" >&2
        echo "soak $*: exit code $code, not $expected" >&2
        exit 1
    fi
}

whole=$(run a 0 --threads 2) || exit 1
if [ "$scale" = 1 ]; then
    run b 4 --threads 1 --views 1 >/dev/null || exit 1
fi
again=$(run b 0 --threads 1) || exit 1
if [ "$whole" != "$again" ]; then
    diff <(echo "$whole") <(echo "$again")
    echo "another answer with one thread after an interruption" >&2
    exit 1
fi
for plant in 1 2; do
    folder_of_plant=$([ $plant = 1 ] && echo c || echo d)
    for part in adversarial cells; do
        run $folder_of_plant 1 --scale 1 --threads 2 --plant $plant --only medley-2k-$part >/dev/null || exit 1
        grep -q "^wrongly-hidden: part medley-2k-$part " "$folder/$folder_of_plant/wrongly-hidden.txt" || exit 1
    done
done
"$soak" --no-such-option 2>/dev/null
[ $? = 2 ] || { echo "an unknown option is not refused" >&2; exit 1; }
echo "$whole"
