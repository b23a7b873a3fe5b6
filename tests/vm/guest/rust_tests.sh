# Runs the tests that need a kernel with CAN, which are ignored elsewhere, of programs that were built outside; TEST_PROGRAMS
# names them.
for program in $TEST_PROGRAMS; do
    "$program" --ignored --test-threads=1 --color=never || exit
done
