# Exit code 1: contribution culling hides what can be seen, and check and explain prove it.
. "$UMBRAGE_SOURCE/tests/cli/common.bash" || exit 1
scene=gen:blocks,g=6
rows="--path gen:blocks,g=6"

run check $scene $rows --every 32 --grid 128x64 --rays 50k
tail -n 4 out | sed -E 's/, budget spent.*//; s/[0-9.]+/N/g'
run check $scene $rows --every 32 --grid 128x64 --rays 50k --min-pixels 40 --json
jq -c '[.class, .wrongly_hidden > 0, .wrongly_hidden == (.wrong | length), (.wrong[0] | keys_unsorted)]' out
row=$(jq '.wrong[0].row' out)
object=$(jq '.wrong[0].object' out)
run explain $scene $rows --row "$row" --object "$object" --min-pixels 40 --json --grid 128x64 --rays 50k |
    sed -E 's/--(row|object) [0-9]+/--\1 N/g'
jq -c '[.verdict, .truth, .witness.confirmed, .reason]' out
run explain $scene $rows --row "$row" --object "$object" --json --grid 128x64 --rays 50k |
    sed -E 's/--(row|object) [0-9]+/--\1 N/g'
jq -c '[.verdict, .truth, .witness.confirmed, .reason]' out

# What stands behind one building after another is hidden, and they are named.
hidden=$("$umbrage" cull $scene $rows --row 5 --json --list | jq -c .ids >seen
    "$umbrage" cull $scene $rows --row 5 --json --list --method none | jq --slurpfile seen seen '.ids - $seen[0] | .[-1]')
"$umbrage" explain $scene $rows --row 5 --object "$hidden" --json --grid 128x64 --rays 50k |
    jq -c '[.verdict, .truth, .reason, (.blockers | length > 0), (.blockers[0] | keys_unsorted)]'

# Half of the objects move by themselves; the oracle looks where they are. Nobody asks for most of them.
run check $scene $rows --every 16 --moving 0.5,3 --step 0.7 --grid 128x64 --rays 50k --json
jq -c '[.class, .wrongly_hidden, .reported_visible > 0]' out
run walk $scene $rows --moving 0.5,3 --json
jq -c '.frames[1:] | [(map(.stats.hidden_movers) | add) > 2 * (map(.stats.poses) | add), (map(.stats.expired + .stats.strays) | add)]' out

# Without some objects the oracle looks at a scene that lacks them; asked about some, the rest still hides.
run check $scene $rows --every 16 --without 0-30,77 --grid 128x64 --rays 50k --json
jq -c '[.class, .wrongly_hidden, .reported_visible > 0]' out
"$umbrage" cull $scene $rows --row 5 --json --list | jq -c '[.ids[] | select(. <= 40 or . == 100)]' >few
"$umbrage" cull $scene $rows --row 5 --only 0-40,100 --json --list | jq -c .ids | same "only" few -
"$umbrage" cull $scene $rows --row 5 --without 0-40,100 --json --list | jq -c '[.ids[] | select(. <= 40 or . == 100)]'
run check $scene $rows --every 16 --only 50-200 --moving 0.3,2 --step 0.5 --grid 128x64 --rays 50k --json
jq -c '[.wrongly_hidden, .reported_visible > 0]' out
