# takt itself, with `takt sim` as the other side, its SYNC seen by a listener of its own: six axes on two virtual
# interfaces, idle and under load, at 1 ms and 2 ms, and with COMPARE=yes without the spin guard; and three axes on the two emulated
# controllers; and a motion, beside clients of every kind that behave badly: threads of a program in Rust, other processes, a program in C,
# one in Python, a controller manager of ros2_control (in C++), nodes of ROS 2 over zenoh; and three hollow-shaft motors over CAN FD, whose requests take the place
# of SYNC. SYNC behind an SLCAN adapter, on a pseudo-terminal, is printed and not judged. TAKT, TAKT_ZENOH, UNRULY_CLIENTS, UNRULY_PROCESSES,
# UNRULY_C and UNRULY_ROS2 name the programs, PYTHON an interpreter with takt, ZENOH_PYTHON one with zenoh; CYCLES, LOAD_CYCLES and OTHER_CYCLES set how long; EVERYTHING=yes has
# clients of every kind (otherwise only threads of a program in Rust, idle), twenty pages of the panel and twenty monitors, SYNC behind the adapter, the 2 ms grid, and more idle and under load; ONLY=words measures only what has them in its
# call below. Leaves product.txt (the table, and
# when set-points and feedback were on the wire), jitter.txt (`takt jitter`), system_calls.txt, the recordings of SYNC and
# the reports. Fails when a mean period drifts, a slot was missed, a period deviates further above what cyclictest finds than
# is allowed, a set-point missed its slot, feedback was late, or there were more system calls than there may be; and beside clients, when
# a set-point broke a limit, anything but a client's own request stopped the axes, or they were not at rest in the end.
. tests/vm/guest/laboratory.sh
cycles=${CYCLES:-10000} load_cycles=${LOAD_CYCLES:-2000} other_cycles=${OTHER_CYCLES:-1000}
# Beyond cyclictest's maximum, in microseconds.
idle_allowance=5 load_allowance=${LOAD_ALLOWANCE:-10}
# Further than any deviation: not limited.
any=100000

mkdir -p "$OUT/configs"
arm=$OUT/configs/arm.toml arm_2ms=$OUT/configs/arm-2ms.toml arm_sleep=$OUT/configs/arm-sleep.toml
arm_vcan=$OUT/configs/arm-vcan.toml half=$OUT/configs/half.toml half_2ms=$OUT/configs/half-2ms.toml leg=$OUT/configs/leg.toml
cp configs/arm6-erob.toml "$arm"
first_bus_only "$arm" > "$half"
two_ms() { sed 's/^period = "1 ms"/period = "2 ms"/' "$1"; }
two_ms "$arm" > "$arm_2ms"
two_ms "$half" > "$half_2ms"
# For a program whose only way to name its interfaces is the configuration.
sed -e '/^name = "base"/,/^interface/s/"sim"/"vcan0"/' -e '/^name = "wrist"/,/^interface/s/"sim"/"vcan1"/' "$arm" > "$arm_vcan"
sed 's/"can"/"base"/' configs/hollow-leg-fd.toml > "$leg"
sed 's/^\[cycle\]/[realtime]\nspin_guard = 0\n\n[cycle]/' "$arm" > "$arm_sleep"

row() { printf '%-20s %-6s %-5s %8s %11s %8s %8s %8s %10s %7s\n' "$@" | tee -a "$OUT/product.txt"; }

# A nanosecond on average, and what the first and the last frame may each be early or late: in 60000 frames that is less.
verdict() { # NOMINAL FRAMES MEAN DEVIATION MISSED LIMIT
    awk -v nominal="$1" -v frames="$2" -v mean="$3" -v deviation="$4" -v missed="$5" -v limit="$6" 'BEGIN {
        drift = mean - nominal
        allowed = 0.001 + (2 * deviation + 1) / (frames - 1)
        bad = missed > 0 ? missed " slots were missed" : deviation > limit ? "a period deviates by " deviation " us, and " limit " are allowed" : \
            (drift > allowed || drift < -allowed) ? "the mean period is off" : ""
        if (bad) { print "takt: " bad > "/dev/stderr"; exit 1 }
    }'
}

latency_max=0
machine() { # idle|load CYCLES
    local count wake
    count=$(at_most_ten_thousand "$2")
    read -r -a wake <<< "$(cyclictest_row "$count")"
    row "cyclictest wake-up" - "$1" "$count" "${wake[1]}" "${wake[0]}" "${wake[2]}" - - -
    latency_max=${wake[2]}
}

# Every frame of the drives, seen by a listener: set-points in their slots, after the feedback of the same slot; and that
# feedback was worked with, by the recording.
wire_verdict() { # PERIOD_US LOG RECORDING
    local status=0 ages
    case $timed in
        080) awk -v period="$1" -f $guest/wire.awk "$2" ;;
        *) awk -v requests="001 002 003" -v replies="065 066 067" -f $guest/requests.awk "$2" ;;
    esac > "$OUT/wire.txt" || status=1
    ages=$(python3 $guest/feedback_age.py "$3") || status=1
    echo "  feedback worked with, by its age in cycles: $ages" | cat "$OUT/wire.txt" - | tee -a "$OUT/product.txt"
    rm "$OUT/wire.txt"
    return $status
}

# What a recording says of the limits, of stops, and of the end.
limits_verdict() { # CONFIG RECORDING
    python3 $guest/limits_kept.py "$@" > "$OUT/limits.txt"
    local status=$?
    tee -a "$OUT/product.txt" < "$OUT/limits.txt"
    rm "$OUT/limits.txt"
    return $status
}

# What is timed, and what else a listener sees; whether the wire is judged, and the limits.
program=("$TAKT" run) timed=080 drive_frames="180:780 200:780" wire=judged limits=ignored
measure() { # NAME idle|load CYCLES ALLOWANCE PERIOD_US CONFIG LISTEN INTERFACE...
    local name=$1 load=$2 count=$3 allowance=$4 period=$5 config=$6 listen=$7 seconds found listener witness status filters buses log
    shift 7
    log=$OUT/$(basename "${program[0]}")-$(basename "$config" .toml)-$load-$listen
    # SYNC begins with the bring-up, so that the motion lasts longer than the recording.
    seconds=$((count * period / 1000000 + 1))
    buses="--bus base=$1 ${2:+--bus wrist=$2}"
    filters=$(printf "%s,$timed:7FF,${drive_frames// /,} " "$@")
    chrt --fifo 1 candump -L -r 4000000 $filters > "$log.wire" & witness=$!
    record "$listen" "$count" "$log.log" "$timed" & listener=$!
    chrt --other 0 "${program[@]}" "$config" $buses --require-realtime --duration $seconds --record "$log.mcap" > "$log.txt" 2>&1
    status=$?
    kill $witness; wait $witness
    [ $status = 0 ] || { cat "$log.txt"; kill $listener; return $status; }
    wait $listener
    read -r -a found <<< "$(periods "$log.log" "$period")"
    row "$name" "$listen" "$load" "${found[@]}"
    wire_verdict "$period" "$log.wire" "$log.mcap" || [ $wire = printed ] || status=1
    [ $limits = ignored ] || limits_verdict "$config" "$log.mcap" || status=1
    grep -oE '[0-9]+ records, [0-9]+ dropped' "$log.txt" | sed 's/^/  recording: /' | tee -a "$OUT/product.txt"
    rm -f "$log.wire" "$log.mcap"
    verdict "$period" "${found[0]}" "${found[1]}" "${found[5]}" "${found[6]}" $((latency_max + allowance)) || status=1
    return $status
}

# A stream, beside clients that flood, stall, observe without a pause, and die. The debug build, which these are, computes for nearly as long
# as there is time before the set-points are due: a cycle that has lost them is printed, and not judged.
beside() { # NAME CONFIG idle|load ALLOWANCE PROGRAM...
    local name=$1 config=$2 load=$3 allowance=$4 wire=printed limits=judged
    shift 4
    local program=("$@")
    measure "takt, $name" "$load" "$other_cycles" "$allowance" 1000 "$config" vcan0 vcan0 vcan1
}
# These programs take minutes to begin and to end, so that of the kinds only the first runs unless all are asked for.
beside_clients() { # idle|load ALLOWANCE
    try beside "bad clients" "$arm" "$@" "$UNRULY_CLIENTS"
    [ -n "${EVERYTHING:-}" ] || return 0
    try beside "bad processes" "$arm" "$@" "$UNRULY_PROCESSES"
    try beside "bad C program" "$arm_vcan" "$@" "$UNRULY_C"
    try beside "bad Python" "$arm" "$@" "$PYTHON" tests/vm/unruly_program.py
    try beside "bad ros2_control" "$arm_vcan" "$@" "$UNRULY_ROS2"
    try attended "bad zenoh nodes" "$@" nodes --serve "$OUT/served"
    # Pages and monitors are a load themselves.
    try attended "watched" "$1" $load_allowance pages_and_monitors --panel 127.0.0.1:8080 --panel-open
}

# With a front for others, beside those who use it: a function has them come, and returns when they are at work; another one has them go.
attended() { # NAME idle|load ALLOWANCE VISITORS OPTION...
    local name=$1 load=$2 allowance=$3 visitors=$4 log=$OUT/$4-$2 run found status=0
    shift 4
    # Until they are at work: under load, an interpreter takes minutes to begin.
    load_off
    chrt --other 0 "$TAKT" run "$arm" --bus base=vcan0 --bus wrist=vcan1 --require-realtime --record "$log.mcap" "$@" > "$log.txt" 2>&1 & run=$!
    "${visitors}_come" "$log" $run || status=1
    [ "$load" = idle ] || load_on vcan0
    [ $status = 0 ] && record vcan0 "$other_cycles" "$log.log" || status=1
    "${visitors}_go" || status=1
    # 130: ended by Ctrl-C, as a person does.
    kill -INT $run; wait $run
    [ $? = 130 ] && [ $status = 0 ] || { tail -n 20 "$log"*.txt; return 1; }
    read -r -a found <<< "$(periods "$log.log" 1000)"
    row "takt, $name" vcan0 "$load" "${found[@]}"
    tail -n 1 "$log-said.txt" | sed 's/^/  /' | tee -a "$OUT/product.txt"
    limits_verdict "$arm" "$log.mcap" || status=1
    rm -f "$log.mcap" "$log"-monitor-*.txt
    verdict 1000 "${found[0]}" "${found[1]}" "${found[5]}" "${found[6]}" $((latency_max + allowance)) || status=1
    return $status
}

# said WORDS FILE PROCESS...: waits until a file has the words, as long as the processes live.
said() {
    local words=$1 file=$2
    shift 2
    until grep -q "$words" "$file"; do kill -0 "$@" || return; sleep 0.2; done
}

# Twenty pages of the panel, for the first of which an axis moves to and fro, and twenty monitors. One after the other: on one processor,
# monitors that start keep the pages from opening.
pages= monitors=()
pages_and_monitors_come() { # LOG RUN
    local bus monitor
    chrt --other 0 python3 $guest/open_pages.py 8080 20 > "$1-said.txt" 2>&1 & pages=$!
    said "an axis moves" "$1-said.txt" $pages "$2" || return
    monitors=()
    for bus in vcan{0,1}{,,,,,,,,,}; do
        chrt --other 0 "$TAKT" monitor --bus "$bus" > "$1-monitor-${#monitors[@]}.txt" 2>&1 & monitors+=($!)
    done
    for monitor in "${!monitors[@]}"; do said . "$1-monitor-$monitor.txt" "${monitors[monitor]}" || return; done
}
pages_and_monitors_go() {
    local status=0 monitor
    for monitor in "${monitors[@]}"; do kill -0 "$monitor" || status=1; done
    kill $pages; wait $pages || status=1
    [ ${#monitors[@]} = 0 ] || { kill "${monitors[@]}"; wait "${monitors[@]}"; }
    return $status
}

# Nodes of ROS 2, over zenoh.
nodes=
nodes_come() { # LOG RUN
    said "served by the name" "$1.txt" "$2" || return
    chrt --other 0 "$ZENOH_PYTHON" tests/vm/unruly_zenoh.py "$OUT/served" > "$1-said.txt" 2>&1 & nodes=$!
    said "the arm moves" "$1-said.txt" $nodes "$2"
}
nodes_go() { kill $nodes; wait $nodes; }

# A leg of hollow-shaft motors, each of which answers its request 500 us later; the request to the first of them is timed. Unlike SYNC,
# it leaves when the set-points of its cycle have been computed, which takes some microseconds more or less.
leg_allowance=10
requests_of_leg() { # idle|load ALLOWANCE
    local timed=001 drive_frames="002:7FF 003:7FF 065:7FF 066:7FF 067:7FF"
    measure "takt, CAN FD leg" "$1" "$other_cycles" "$2" 1000 "$leg" vcan2 vcan2
}

leg_under_load() {
    load_on vcan2
    machine load "$other_cycles"
    try requests_of_leg load $load_allowance
    try behind_adapter load
    load_off
}

controllers_under_load() {
    load_on can0
    machine load "$other_cycles"
    try measure "takt, SJA1000" load "$other_cycles" $load_allowance 1000 "$half" can1 can0
    try measure "takt, SJA1000, 2 ms" load "$other_cycles" $load_allowance 2000 "$half_2ms" can1 can0
    load_off
}

# Both ways of waiting, as takt itself sees them.
jitter() { # idle|load INTERFACE
    "$TAKT" jitter --bus "$2" --cycles 1000 2>/dev/null > "$OUT/jitter-$1.txt" || return
    echo "takt jitter, $1, ${2%%:*}" >> "$OUT/jitter.txt"
    grep -E '── |^latency|^wake-up|^SYNC release|^missed' "$OUT/jitter-$1.txt" >> "$OUT/jitter.txt"
    rm "$OUT/jitter-$1.txt"
}

# SYNC as text on a pseudo-terminal: takt's own table, and what a reader at the other end saw.
behind_adapter() { # idle|load
    local adapter=$OUT/../adapter log=$OUT/slcan-$1.log reader status found
    chrt --fifo 1 python3 $guest/slcan_reader.py "$adapter" "$log" & reader=$!
    until [ -e "$adapter" ]; do kill -0 $reader || return; sleep 0.1; done
    jitter "$1" "slcan:$adapter"; status=$?
    kill $reader; wait $reader
    [ $status = 0 ] || return $status
    read -r -a found <<< "$(periods "$log" 1000)"
    row "takt jitter, SLCAN" pty "$1" "${found[@]}"
}

# What the real-time thread asks of the kernel in some hundred cycles of motion; traced by the kernel, which stops nobody.
system_calls() {
    local tracing=/sys/kernel/tracing status
    mountpoint -q $tracing || mount -t tracefs tracefs $tracing
    chrt --other 0 "$TAKT" run "$arm" --bus base=vcan0 --bus wrist=vcan1 --require-realtime --duration 4 > "$OUT/traced.txt" 2>&1 & local run=$!
    sleep 3
    echo 'comm == "takt-rt"' > $tracing/events/raw_syscalls/sys_enter/filter
    echo 1 > $tracing/events/raw_syscalls/sys_enter/enable
    sleep 0.5
    echo 0 > $tracing/events/raw_syscalls/sys_enter/enable
    wait $run || return
    awk -v buses=2 -f $guest/system_calls.awk $tracing/trace > "$OUT/system_calls.txt"
    status=$?
    echo > $tracing/trace
    return $status
}

failed=0
try() {
    case "$*" in *"${ONLY:-}"*) "$@" || failed=1 ;; esac
}

chrt --fifo --pid 1 $$ >/dev/null
shorten_page_lists
vcan_up vcan0
vcan_up vcan1
vcan_up vcan2 72
row "(microseconds)" bus load frames mean min max range deviation missed

machine idle "$cycles"
drives_on 70 "$arm" vcan0 vcan1
try measure "takt" idle "$cycles" $idle_allowance 1000 "$arm" vcan0 vcan0 vcan1
[ -z "${COMPARE:-}" ] || try measure "takt, sleep only" idle "$(at_most_ten_thousand "$other_cycles")" $any 1000 "$arm_sleep" vcan0 vcan0 vcan1
in_a_long_run try measure "takt, 2 ms" idle "$other_cycles" $idle_allowance 2000 "$arm_2ms" vcan0 vcan0 vcan1
beside_clients idle $idle_allowance
try system_calls
in_a_long_run try jitter idle vcan0

load_on vcan0
machine load "$load_cycles"
try measure "takt" load "$load_cycles" $load_allowance 1000 "$arm" vcan0 vcan0 vcan1
[ -z "${COMPARE:-}" ] || try measure "takt, sleep only" load "$(at_most_ten_thousand "$other_cycles")" $any 1000 "$arm_sleep" vcan0 vcan0 vcan1
in_a_long_run try measure "takt, 2 ms" load "$other_cycles" $load_allowance 2000 "$arm_2ms" vcan0 vcan0 vcan1
in_a_long_run beside_clients load $load_allowance
in_a_long_run try jitter load vcan0
load_off
drives_off

machine idle "$other_cycles"
drives_on 70 "$leg" vcan2
try requests_of_leg idle $leg_allowance
in_a_long_run try behind_adapter idle
in_a_long_run leg_under_load
drives_off

# Only the emulated machine has them; another one's controllers may be in use.
if [ "$TAKT_VM" != host ]; then
    controllers_up
    # Below the interrupts, as drives are that have a processor of their own.
    drives_on 40 "$half" can1
    machine idle "$other_cycles"
    try measure "takt, SJA1000" idle "$other_cycles" $idle_allowance 1000 "$half" can1 can0
    in_a_long_run try measure "takt, SJA1000, 2 ms" idle "$other_cycles" $idle_allowance 2000 "$half_2ms" can1 can0
    in_a_long_run controllers_under_load
    drives_off
fi

for table in system_calls jitter; do
    echo
    [ ! -f "$OUT/$table.txt" ] || cat "$OUT/$table.txt"
done
exit $failed
