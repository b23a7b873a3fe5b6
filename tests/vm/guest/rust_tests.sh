# Runs test programs that were built outside; TEST_PROGRAMS names them.
for program in $TEST_PROGRAMS; do
    "$program" --test-threads=1 --color=never || exit
done
