# Captured frames: answered again, the same; damaged, refused.
. "$UMBRAGE_SOURCE/tests/cli/common.bash" || exit 1
view="--path gen:blocks,g=6 --row 5"

"$umbrage" generate gen:blocks,g=6 -o scene.glb >out
for index in bvh flat kdtree,median octree; do
    for method in raster none; do
        run cull scene.glb $view --index $index --method $method --capture frame.umb --json
        hash=$(jq -r .hash out)
        run replay frame.umb --json
        jq -c --arg hash "$hash" 'keys_unsorted, [.same, .differences, .method, .index, .hash == $hash,
                                  .captured_hash == $hash]' out
    done
done
run cull gen:city,triangles=10k --path gen:city,triangles=10k --row 7 --capture city.umb --ortho 30
run replay city.umb --threads 2 --isa scalar
sed -E 's/[0-9]+|hash [0-9a-f]+/N/g' out

# In motion, with objects left out and candidates.
for method in raster none planes; do
    run cull scene.glb $view --method $method --moving 0.6,4 --step 0.4 --without 7 --only 0-300 --capture moving.umb --json
    run replay moving.umb --json
    jq -c '[.same, .differences, .method]' out
done

size=$(wc -c <frame.umb)
for cut in 1 16 100 $((size / 2)) $((size - 1)); do
    head -c $cut frame.umb >short.umb
    refused replay short.umb | sed 's/ -> / cut -> /'
done
cat frame.umb <(echo) >long.umb
refused replay long.umb
for at in 0 5 9 20 64 $((size / 3)) $((size / 2)) $((size - 1)); do
    byte=$(od -An -tu1 -j $at -N 1 frame.umb)
    cp frame.umb damaged.umb
    printf "\\$(printf %o $(((byte + 1) % 256)))" | dd of=damaged.umb bs=1 seek=$at conv=notrunc status=none
    refused replay damaged.umb
done

: >empty
refused replay missing.umb
refused replay empty
refused replay scene.glb
refused cull scene.glb $view --capture none/frame.umb
ls
