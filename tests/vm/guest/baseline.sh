# The machine's own jitter, and that of other SYNC sources: cyclictest, the kernel's broadcast manager and a FIFO cangen, 1 ms each, idle
# and under load. CYCLES and LOAD_CYCLES set how long, up to 10000. Leaves baseline.txt (the table) and the recordings.
. tests/vm/guest/laboratory.sh
cycles=$(at_most_ten_thousand "${CYCLES:-10000}") load_cycles=$(at_most_ten_thousand "${LOAD_CYCLES:-2000}")

broadcast_manager() { # CYCLES FILE
    # bcmserver takes its commands over TCP: add a cyclic frame, every 0 s 1000 us, identifier 080, no data.
    bcmserver & local server=$!
    sleep 0.2
    exec 8<> /dev/tcp/127.0.0.1/28600
    printf '< vcan0 A 0 1000 80 0 >' >&8
    record vcan0 "$1" "$2"
    exec 8>&-
    kill "$server"; wait "$server" 2>/dev/null
}

fifo_cangen() { # CYCLES FILE
    chrt -f 80 cangen vcan0 -g 1 -I 80 -L 0 & local sender=$!
    record vcan0 "$1" "$2"
    kill "$sender"; wait "$sender" 2>/dev/null
}

row() { printf '%-18s %-5s %8s %11s %8s %8s %8s %10s %7s\n' "$@" | tee -a "$OUT/baseline.txt"; }

measure() { # idle|load CYCLES
    local wake
    read -r -a wake <<< "$(cyclictest_row "$2")"
    row "cyclictest wake-up" "$1" "$2" "${wake[1]}" "${wake[0]}" "${wake[2]}" - - -
    broadcast_manager "$2" "$OUT/bcm-$1.log"
    row "broadcast manager" "$1" $(periods "$OUT/bcm-$1.log" 1000) || exit 1
    fifo_cangen "$2" "$OUT/cangen-$1.log"
    row "FIFO cangen" "$1" $(periods "$OUT/cangen-$1.log" 1000) || exit 1
}

# Above the load and below all that is measured, so that the load does not starve this script.
chrt --fifo --pid 1 $$
shorten_page_lists
vcan_up vcan0
row "(microseconds)" load frames mean min max range deviation missed
measure idle "$cycles"
load_on vcan0
measure load "$load_cycles"
load_off
