# region: the sandwich seen <= refined <= pvs, the check, and bad cells. Answers do not depend on threads.
. "$UMBRAGE_SOURCE/tests/cli/common.bash" || exit 1
scene=gen:city,triangles=20k
cell="--cell 46,0.5,38,52,3,44"

run region $scene $cell --check --rays 200k --json
jq -c '[.wrongly_hidden, .wrong, .unconfirmed, .rays >= 200000, .budget_spent, (.progress | length > 0)]' out
jq -c '[.seen > 0, .seen <= .upper, .upper <= .pvs, .pvs <= .objects]' out
jq -c '[.seen_triangles <= .upper_triangles, .upper_triangles <= .pvs_triangles, .triangles_met <= .seen_triangles]' out
steady <out | sed -E 's/"refine_ms":[^,]*/"refine_ms":0/' >one
run region $scene $cell --check --rays 200k --json --threads 3
steady <out | sed -E 's/"refine_ms":[^,]*/"refine_ms":0/' >three
same "threads" one three

run region $scene $cell --rays 0 --json
jq -c 'has("seen")' out
run region $scene $cell --rays 20k
grep -c '^seen ' out
run region $scene $cell --rays 20k --picture map.png --size 320x200
head -c 4 map.png | tail -c 3
echo
run region $scene $cell --rays 20k --picture none/map.png
run region $scene $cell --check --rays 100k --near 0.5 --two-sided --json
jq -c '.wrongly_hidden' out
