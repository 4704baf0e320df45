# Generated scenes as files, and what an interrupt leaves.
. "$UMBRAGE_SOURCE/tests/cli/common.bash" || exit 1
view="--path gen:blocks,g=6 --row 5"

run generate gen:blocks,g=6 -o scene.glb
cat out
about() {
    "$umbrage" info "$1" --json --list |
        jq -c '[.objects, .triangles, .bounds, .up, [.list[] | [.name, .triangles, .bounds]]]'
}
about gen:blocks,g=6 >generated
about scene.glb >read
same "the scene read again" generated read
"$umbrage" cull gen:blocks,g=6 $view --json --list | steady | jq -c '[.hash, .ids]' >cull_generated
"$umbrage" cull scene.glb $view --json --list | steady | jq -c '[.hash, .ids]' >cull_read
same "its visible set" cull_generated cull_read

ls
# A long check, interrupted once it runs.
"$umbrage" check gen:city,triangles=200k --path gen:city,triangles=200k --progress >out 2>err &
for try in $(seq 600); do
    grep -q views err && break
    sleep 0.1
done
kill -INT $!
wait $!
echo "interrupted check -> $?, $(wc -c <out) bytes; $(tail -n 1 err)"

# A file, interrupted while it is written: it is whole or not there.
"$umbrage" generate gen:city,triangles=4M -o city.glb >out 2>err &
for try in $(seq 6000); do
    [ -n "$(find . -name 'city.glb*')" ] && break
    sleep 0.01
done
kill -TERM $!
wait $!
code=$?
case $code in
0) [ -f city.glb ] && "$umbrage" info city.glb >out || echo "not whole" ;;
4) [ ! -e city.glb ] || echo "there" ;;
*) echo "interrupted generate -> $code" ;;
esac
rm -f city.glb
ls
