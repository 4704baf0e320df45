# Help texts, and that the manual page knows every option and no other.
. "$UMBRAGE_SOURCE/tests/cli/common.bash" || exit 1
"$umbrage" --help
"$umbrage" --version
commands=$("$umbrage" --help | sed -n 's/^  \([a-z]*\) .*/\1/p')
for command in $commands; do
    echo
    "$umbrage" "$command" --help
    "$umbrage" "$command" -h | cmp - <("$umbrage" "$command" missing --help)
    "$umbrage" "$command" --help | grep -oE -- '--[a-z][a-z-]*' | grep -v -- '--help'
done | tee all | awk 'BEGIN { show = 1 } { if ($0 ~ /^--/) next; print }'
manual=$UMBRAGE_SOURCE/docs/umbrage.1
grep -oE '^--[a-z-]+' all | sort -u >helped
sed 's/\\-/-/g' "$manual" | grep -oE -- '--[a-z][a-z-]*' | grep -vE -- '--(help|version|name)$' | sort -u >written
echo
same "options of --help and of the manual" helped written
for command in $commands; do
    grep -q "^\.B $command\$" "$manual" || echo "the manual does not describe $command"
done
