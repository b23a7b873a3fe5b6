# Reads the kernel's trace of one thread's system calls (raw_syscalls:sys_enter) and prints how many of each the loop made
# in a cycle at most, and what it may make. Fails when there were more, or others. A cycle begins with its first receive.
# Run with -v buses=2. The numbers are those of x86_64.
BEGIN {
    name[230] = "clock_nanosleep"; name[307] = "sendmmsg"; name[299] = "recvmmsg"
    name[44] = "sendto"; name[54] = "setsockopt"
    # SYNC of all buses leaves in one call, and so do the set-points.
    allowed[230] = 2; allowed[307] = 2; allowed[299] = buses
    # The way of sending walked beforehand, where there are locks (rt/src/linux/send_path.rs).
    allowed[44] = allowed[54] = 1
}
function finish_cycle(call, sum) {
    for (call in count) {
        if (cycles > 0 && count[call] > most[call]) most[call] = count[call]
        if (cycles > 0) total[call] += count[call]
        sum += count[call]
        delete count[call]
    }
    if (cycles > 0 && sum > most_of_all) most_of_all = sum
    cycles++
}
match($0, /sys_enter: NR [0-9]+/) {
    call = substr($0, RSTART + 14, RLENGTH - 14) + 0
    if (call == 299 && previous != 299) finish_cycle()
    count[call]++
    previous = call
}
END {
    # The first cycle and the last one are not whole.
    cycles -= 1
    printf "system calls of the real-time thread in %d cycles on %d buses\n", cycles, buses
    for (call in most) {
        printf "  %-16s at most %d in a cycle (%d allowed), %.3f on average\n", (call in name) ? name[call] : "number " call, most[call], allowed[call], total[call] / cycles
        if (most[call] > allowed[call]) bad = 1
    }
    # One sleep, two sends and one receive a bus.
    printf "  %-16s at most %d in a cycle (%d allowed)\n", "together", most_of_all, 4 * buses
    if (cycles < 100 || bad || most_of_all > 4 * buses) { print "system calls: more than allowed, or too few cycles seen" > "/dev/stderr"; exit 1 }
}
