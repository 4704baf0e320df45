# What the JSON of each subcommand holds, and that it agrees with itself.
. "$UMBRAGE_SOURCE/tests/cli/common.bash" || exit 1
scene=gen:blocks,g=6
view="--path gen:blocks,g=6 --row 5"

# keys FILE: the keys of the object, and that it is on one line.
keys() {
    jq -c 'keys_unsorted' "$1"
    [ "$(wc -l <"$1")" = 1 ] || echo "$1: more than one line"
}

"$umbrage" info $scene --json --list >info
keys info
jq -c '[.objects, .triangles, .bounds.min, .up, (.list | length), .list[0], (.faults | add)]' info
"$umbrage" cull $scene $view --json --list --method none >cull
keys cull
jq -c '[.method, .class, .index, .objects, .in_frustum == .visible, .occluders, .hash]' cull
jq -c '[(.ids | length) == .visible, (.ids | unique | length) == .visible, (.hash | test("^[0-9a-f]{16}$"))]' cull
"$umbrage" cull $scene $view --json | jq -c '[.method, .class, .visible <= .in_frustum, has("ids")]'
"$umbrage" cull $scene $view --json --method none --index flat --list |
    jq -c '[.hash, .index]'
"$umbrage" cull $scene --eye 0,99,0 --target 0,100,0 --json --list | jq -c '[.visible, .hash, .ids]'
"$umbrage" walk $scene --path gen:blocks,g=6 --every 9 --json --list >walk
keys walk
jq -c '.summary | keys_unsorted' walk
jq -c '.frames[0] | keys_unsorted' walk
jq -c '[.summary.frames == (.frames | length),
        .summary.visible_mean == ([.frames[].visible] | add / length),
        .summary.median_ms <= .summary.p99_ms,
        ([.frames[] | (.ids | length) == .visible] | all)]' walk
"$umbrage" check $scene --path gen:blocks,g=6 --every 16 --grid 64x32 --rays 20k --json >check
keys check
jq -c '.culling | keys_unsorted' check
jq -c '.frames[0] | keys_unsorted' check
jq -c '[.wrongly_hidden, .unconfirmed, (.wrong | length), .views,
        .truth_visible == ([.frames[].truth_visible] | add),
        .reported_visible == ([.frames[].reported_visible] | add),
        .rays == ([.frames[].rays] | add),
        .truth_visible > 0, .truth_visible >= .culling.truth_visible,
        .truth_visible >= .two_sided.truth_visible,
        .conservativity == .reported_visible / .truth_visible, .conservativity >= 1]' check
"$umbrage" check $scene --eye 1,2,3 --target 40,2,9 --grid 64x32 --rays 20k --json |
    jq -c '[.views, .wrongly_hidden, has("frames")]'
first=$(jq '.ids[0]' cull)
"$umbrage" explain $scene $view --object "$first" --grid 64x32 --rays 20k --json >explain
keys explain
jq -c '[.object, .verdict, .truth, (.witness | keys_unsorted), (.witness.from | length)]' explain
"$umbrage" generate $scene -o scene.glb --json >generate
keys generate
jq -c . generate
