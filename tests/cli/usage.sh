# Wrong usage: exit code 2, one line on standard error, no help text.
. "$UMBRAGE_SOURCE/tests/cli/common.bash" || exit 1
view="--eye 1,2,3 --target 4,2,9"
scene=gen:blocks,g=2

run
run nosuch
run region
run region gen:blocks,g=2
run region gen:blocks,g=2 --cell 1,2,3,4,5
run region gen:blocks,g=2 --cell 1,2,3,0,5,6
run region gen:blocks,g=2 --cell 1,2,3,4,5,6 --resolution 32
run region gen:blocks,g=2 --cell 1,2,3,4,5,6 --umbrae 9
run region gen:blocks,g=2 --cell 1,2,3,4,5,6 --outer 1
run region gen:blocks,g=2 --cell 1,2,3,4,5,6 --near -1
run region gen:blocks,g=2 --cell 1,2,3,4,5,6 --up 1,1,0
run region gen:blocks,g=2 --cell 1,2,3,4,5,6 --all-round --outer 2
run --nosuch
run info
run info --nosuch x
run info x --eye 1,2,3
run info x y
run info --list=yes x
run cull $scene
run cull $scene --eye 1,2,3
run cull $scene --eye
run cull $scene --eye 1,2 --target 1,2,3
run cull $scene --eye 1,2,3,4 --target 1,2,3
run cull $scene --eye 1,2,x --target 1,2,3
run cull $scene --eye 1,2,nan --target 1,2,3
run cull $scene --eye 1,2,inf --target 1,2,3
run cull $scene --eye 0x1,2,3 --target 1,2,3
run cull $scene --eye 1,2,3 --target 1,2,3
run cull $scene --eye 1e300,2,3 --target 1,2,3
run cull $scene --eye=1e400,2,3 --target 1,2,3
run cull $scene --eye= --target 1,2,3
run cull $scene $view --up 0,0,0
run cull $scene $view --up w
run cull $scene $view --fov 0
run cull $scene $view --fov 180
run cull $scene $view --fov -60
run cull $scene $view --ortho 0
run cull $scene $view --ortho 5 --fov 60
run cull $scene $view --ortho 5 --far inf
run cull $scene $view --spot 180
run cull $scene $view --spot 50 --fov 60
run cull $scene $view --spot 50 --far inf
run cull $scene --eye 1,2,3 --spot 50
run cull $scene $view --cube x
run cull $scene $view --cube +x --sun 1,2,3
run cull $scene --eye 1,2,3 --cube +x --near 0
run cull $scene $view --sun 0,0,0
run cull $scene $view --sun 0,-1,0 --far inf
run cull $scene $view --sun 0,-1,0 --slice 9,9
run cull $scene $view --sun 0,-1,0 --slice 9000,9900
run cull $scene $view --sun 0,-1,0 --reach -1
run cull $scene $view --slice 1,9
run cull $scene $view --reach 5
run cull $scene $view --plane 0,0,0,1
run cull $scene $view --plane 1,2,3
run cull $scene $view $(printf -- '--plane 1,0,0,%s ' 1 2 3 4 5 6 7 8 9 10 11)
run cull $scene $view --spot 50 $(printf -- '--plane 1,0,0,%s ' 1 2 3 4 5 6 7)
run cull $scene $view --size 0x512
run cull $scene $view --size 1024
run cull $scene $view --size 1024x
run cull $scene $view --size -3x5
run cull $scene $view --size 99999x99999
run cull $scene $view --buffer 0x0
run cull $scene $view --buffer 8193x8
run cull $scene $view --near 0
run cull $scene $view --near -1
run cull $scene $view --near 5 --far 5
run cull $scene $view --far -inf
run cull $scene $view --min-pixels -1
run cull $scene $view --method hzb
run cull $scene $view --index heap
run cull $scene $view --index kdtree,sah
run cull $scene $view --update often
run cull $scene $view --index flat --update lca
run walk $scene --path gen:blocks --update overlapping --index grid,nested
run cull $scene $view --isa mmx
run cull $scene $view --threads 0
run cull $scene $view --threads 257
run cull $scene $view --threads 1.5
run cull $scene $view --split 0
run cull $scene $view --seed -1
run cull $scene $view --seed 99999999999999999999
run cull $scene $view --repeat 0
run cull $scene $view --row 3
run cull $scene $view --path gen:blocks
run cull $scene $view --from 3
run cull $scene --path gen:blocks --row 64
run cull $scene $view --coherence list
run walk $scene --path gen:blocks --coherence list,,rest
run walk $scene --path gen:blocks --coherence lists
run walk $scene --path gen:blocks --occluder-budget 0
run walk $scene --path gen:blocks --moving 2,1
run walk $scene --path gen:blocks --moving 0.5
run check $scene --path gen:blocks --step 1
run check $scene --path gen:blocks --moving 0.5,1 --step 0
run explain $scene $view --object 1 --moving 0.5,1
run cull $scene $view --only 1,
run cull $scene $view --only 5-3
run cull $scene $view --only 4000
run cull $scene $view --without ""
run walk $scene --path gen:blocks --without 1-4294967296
run walk $scene
run walk $scene --path gen:blocks --from 64
run walk $scene --path gen:blocks --from 5 --to 4
run walk $scene --path gen:blocks --every 0
run check $scene --path gen:blocks --grid 5
run check $scene --path gen:blocks --rays 0
run check $scene $view --every 2
run explain $scene $view
run explain $scene $view --object 44
run explain $scene $view --object -1
run render $scene $view
run render $scene $view --what sky -o x.png
run generate $scene
run generate scene.glb -o x.glb
run cull gen:nosuch $view
run cull gen:blocks,h=2 $view
run cull gen:blocks,g=0 $view
run walk $scene --path gen:nosuch
run replay
echo "1,2,3,1,2,3" >same.csv
run walk $scene --path same.csv
ls
