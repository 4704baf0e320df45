# How options are written: what must be the same, is.
. "$UMBRAGE_SOURCE/tests/cli/common.bash" || exit 1

ask() {
    "$umbrage" cull gen:blocks,g=8 --json --list --repeat 1 "$@" | steady
}

ask --eye -30,1.7,-4 --target 20,1.7,-3 >spaced
ask --eye=-30,1.7,-4 --target=20,1.7,-3 >joined
same "--name value and --name=value" spaced joined
ask --target 20,1.7,-3 --eye 9,9,9 --eye -30,1.7,-4 >last
same "the last of equal options counts" spaced last
ask --eye -3e1,+1.7,-4.0 --target 2E1,1.70,-3. >written
same "numbers written in other ways" spaced written
"$umbrage" cull --json --list --repeat 1 --eye -30,1.7,-4 --target 20,1.7,-3 -- gen:blocks,g=8 | steady >ended
same "options before the scene, --" spaced ended
ask --eye -30,1.7,-4 --target 20,1.7,-3 --up y --fov 60 --size 1024x512 --near 0.1 --buffer 1024x288 \
    --method raster --index bvh --threads 1 --isa auto --min-pixels 0 --seed 5 >defaults
same "defaults said aloud" spaced defaults
ask --eye -30,1.7,-4 --target 20,1.7,-3 --up 0,-5,0 >turned
ask --eye -30,1.7,-4 --target 20,1.7,-3 --up 0,3,0 >long
same "up of another length" spaced long
jq -c '.in_frustum' spaced turned | uniq | wc -l
ask --eye -30,1.7,-4 --target 20,1.7,-3 --far inf >endless
same "far inf" spaced endless
ask --eye -30,1.7,-4 --target 20,1.7,-3 --threads 3 >threads
same "threads" spaced threads
ask --eye -30,1.7,-4 --target 20,1.7,-3 --isa scalar >scalar
same "isa" spaced scalar
ask --method none --eye 0,50,0 --target 0,0,0 >down
ask --method none --eye 0,50,0 --target 0,0,0 --up z >down_z
same "looking along up, z takes its place" down down_z

printf 'ex,ey,ez,tx,ty,tz\n0,1,0,9,1,0\n-30,1.7,-4,20,1.7,-3\n' >path.csv
ask --path path.csv --row 1 >row
same "a row of a path, header not counted" spaced row
printf -- '-30,1.7,-4,20,1.7,-3\n' >bare.csv
ask --path bare.csv >bare
same "a path without header" spaced bare

"$umbrage" walk gen:blocks,g=8 --path gen:blocks,g=8 --from 3 --to 20 --every 5 --json |
    jq -c '[.frames[].row]'
"$umbrage" walk gen:blocks,g=8 --path gen:blocks,g=8 --to 99999 --every 63 --json | jq -c '[.frames[].row]'
remembered() {
    "$umbrage" walk gen:blocks,g=8 --path gen:blocks,g=8 --to 9 --json "$@" |
        jq -c '[.frames[] | .stats + {occluders}] | [([.[].early] | add > 0), ([.[].saved] | add > 0),
               ([.[].over_budget] | add > 0), ([.[].occluders] | max <= 3)]'
}
remembered
remembered --coherence none
remembered --coherence list,hierarchy
remembered --coherence all --occluder-budget 3
# However the index follows what moves, the frustum holds the same.
moved() {
    "$umbrage" walk gen:blocks,g=8 --path gen:blocks,g=8 --to 20 --moving 0.3,20 --step 0.2 --method none --json "$@" |
        jq -c '.frames[] | [.visible, .hash]'
}
moved >followed
for way in refit delete-insert lca lazy deepest incremental; do
    moved --update $way >way
    same "--update $way" followed way
done
moved --update overlapping --index grid >way
same "--update overlapping" followed way
"$umbrage" walk gen:blocks,g=8 --path gen:blocks,g=8 --to 0 --update lca --index octree,loose --json | jq -c '.frames[] | [.index, .update]'
"$umbrage" info gen:city,triangles=5k,seed=3 --json | jq -c '[.objects,.triangles,.bounds]' >seed_key
"$umbrage" info gen:city,triangles=5k --seed 3 --json | jq -c '[.objects,.triangles,.bounds]' >seed_option
same "--seed and seed=" seed_key seed_option
ask --eye 0,0,-50 --target 0,0,0 --ortho 40 --near -10 --far 90 | jq -c '[.class,.in_frustum > 0]'
ask --eye -30,1.7,-4 --target 20,1.7,-3 --min-pixels 30 | jq -c '[.class,.stats.small > 0]'

# Views of lights. A spot's cone lies in the square that a camera of the same angle shows, and reaches from
# --near to --far; a cube's face is a camera of 90 degrees; planes cut.
where="--eye -30,1.7,-4 --target 20,1.7,-3"
held() {
    ask --method none "$@" | jq -c '.ids[]' | sort
}
down="--eye 0,60,0 --target 1,0,1 --far 80"
held $down --fov 60 --size 512x512 >square
held $down --spot 60 >spot
echo "a spot's cone and the square around it: $(comm -13 square spot | wc -l) more, $(wc -l <spot) of $(wc -l <square)"
held --eye 3,1.7,4 --cube -z --far 80 >face
held --eye 3,1.7,4 --target 3,1.7,-6 --fov 90 --size 512x512 --far 80 >camera
same "a cube's face and a camera of 90 degrees" face camera
held $where >whole
held $where --plane 0,0,1,4 --plane=1,0,0,10 >cut
echo "planes: $(comm -13 whole cut | wc -l) more, $(wc -l <cut) of $(wc -l <whole)"
held $where --sun -3,-1,0.5 --slice 1,30 >cascade
held $where --sun -3,-1,0.5 --slice 1,30 --reach 1000 >far
held $where --sun -3,-1,0.5 --slice 1,30 --reach 2 >short
same "the sun reaches as far as the scene" cascade far
echo "a short reach: $(comm -13 cascade short | wc -l) more, $(wc -l <short) of $(wc -l <cascade)"
