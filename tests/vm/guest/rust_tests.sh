# Runs the tests that need a kernel with CAN, which are ignored elsewhere, of the program TEST_PROGRAM, which was built outside.
"$TEST_PROGRAM" socketcan:: --ignored --test-threads=1 --color=never
