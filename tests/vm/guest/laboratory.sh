# What the guest's scripts share: interfaces, background load, and recordings of a periodic frame. To be sourced.

guest=tests/vm/guest

# in_a_long_run COMMAND...: with EVERYTHING=yes alone. What resembles another check that every test run has takes the emulated machine a
# minute, and with all of it a test run would take half an hour longer.
in_a_long_run() { [ -z "${EVERYTHING:-}" ] || "$@"; }

# vcan_up INTERFACE [MTU]: brings a virtual interface up; one with 72 bytes takes CAN FD frames.
vcan_up() {
    ip link show "$1" >/dev/null 2>&1 || ip link add dev "$1" type vcan
    ip link set "$1" mtu "${2:-16}" up
}

# What `takt doctor` advises where it finds long lists of free pages; another one's machine is left as it is.
shorten_page_lists() {
    [ "$TAKT_VM" = host ] || echo 1000000 > /proc/sys/vm/percpu_pagelist_high_fraction
}

# Brings both emulated SJA1000 controllers up at 1 Mbit/s. They sit on one bus and acknowledge each other.
controllers_up() {
    local interface
    for interface in can0 can1; do
        # Only a controller that is down takes a bit rate.
        ip link set "$interface" down
        ip link set "$interface" up type can bitrate 1000000 restart-ms 100
    done
    interrupts_first
}

# The interrupt threads of the controllers come before takt: a frame of somebody else that has just been sent must make way
# for SYNC. A controller that goes down and up has a new one.
interrupts_first() {
    local thread
    for thread in $(pgrep '^irq/.*can'); do
        chrt --fifo --pid 85 "$thread"
    done
}

load_pids=()

# background COMMAND...: repeats a command at ordinary priority until load_off.
background() {
    setsid chrt --other 0 bash -c 'while :; do "$@"; done' background "$@" >/dev/null 2>&1 &
    load_pids+=($!)
}

# Loads disk, file system, scheduler, memory and the CAN interface given, until load_off.
load_on() {
    background dd if=/dev/zero of="$OUT/../share/scratch" bs=64k count=16 conv=fsync
    background ls -lR /usr/lib /usr/share
    background hackbench --groups 2 --fds 10 --loops 100
    background stress-ng --timeout 5 --switch 1 --timer 1 --mmap 1 --mmap-bytes 16m --fork 1
    background cangen "$1" -g 1 -I 6AA -L 8 -i
}

load_off() {
    local pid
    for pid in "${load_pids[@]}"; do
        # Each leads a process group of its own (setsid).
        kill -KILL -- "-$pid"
        wait "$pid"
    done 2>/dev/null
    load_pids=()
    rm -f "$OUT/../share/scratch"
}

# record INTERFACE FRAMES FILE [IDENTIFIER]: so many SYNC frames (080), or frames of another identifier, with kernel time stamps, by a
# listener that has nothing to do with the sender.
record() {
    chrt --fifo 1 candump -L -r 4000000 -n "$2" "$1,${4:-080}:7FF" > "$3"
}

# periods FILE PERIOD_US
periods() {
    awk -v nominal="$2" -f $guest/periods.awk "$1"
}

# at_most_ten_thousand CYCLES: for what takt is only compared with. Over more cycles the largest can only be larger.
at_most_ten_thousand() {
    echo $(($1 < 10000 ? $1 : 10000))
}

# cyclictest_row CYCLES: shortest, mean and longest wake-up latency in microseconds.
cyclictest_row() {
    cyclictest --mlockall --quiet --priority=90 --interval=1000 --loops="$1" \
        | sed -n 's/.*Min: *\([0-9]*\).*Avg: *\([0-9]*\).*Max: *\([0-9]*\).*/\1 \2 \3/p'
}

# first_bus_only CONFIG: paragraph by paragraph, without the axes of the second bus.
first_bus_only() {
    awk -v RS= -v ORS='\n\n' '/^\[\[axis\]\]/ { is_left_out = /bus = "wrist"/ } /^\[\[program/ { is_left_out = 0 }
        !is_left_out && !/name = "wrist"/' "$1" | sed -E 's/^(to = \[[^,]+,[^,]+,[^,]+),.*\]/\1]/'
}

# drives_on PRIORITY CONFIG LEFT [RIGHT]: the other side, until drives_off.
drives=
drives_on() {
    local priority=$1
    shift
    chrt --fifo "$priority" "$TAKT" sim "$1" --bus base="$2" ${3:+--bus wrist=$3} 2> "$OUT/sim.txt" & drives=$!
    sleep 1
}
drives_off() { kill "$drives"; wait "$drives"; }
