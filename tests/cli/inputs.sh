# Inputs that cannot be read, outputs that cannot be written: exit code 3.
. "$UMBRAGE_SOURCE/tests/cli/common.bash" || exit 1
view="--eye 1,2,3 --target 4,2,9"

mkdir folder.glb
: >empty
for kind in glb gltf obj ply stl ac ifc bsp json pk3 nosuch; do
    : >empty.$kind
    printf 'IBSP this is not a scene of any kind \n\0\1\2' >wrong.$kind
    refused info missing.$kind
    refused info empty.$kind
    refused info wrong.$kind
done
refused info folder.glb
refused info empty
refused info ""
refused info wrong.pk3:maps/none.bsp
"$umbrage" generate gen:blocks,g=2 -o whole.glb >out
for size in 4 12 20 100 2000; do
    head -c $size whole.glb >short.glb
    refused info short.glb
done
refused cull missing.glb $view

refused walk gen:blocks,g=2 --path missing.csv
refused walk gen:blocks,g=2 --path empty
echo "ex,ey,ez,tx,ty,tz" >header.csv
refused walk gen:blocks,g=2 --path header.csv
echo "1,2,3,4,5" >five.csv
refused walk gen:blocks,g=2 --path five.csv
printf '1,2,3,4,5,6\n1,2,3,nan,5,6\n' >nan.csv
refused walk gen:blocks,g=2 --path nan.csv

refused generate gen:blocks,g=2 -o none/x.glb
refused generate gen:blocks,g=2 -o folder.glb
refused render gen:blocks,g=2 $view --size 16x8 -o none/x.png
find . -name '*.part*'
