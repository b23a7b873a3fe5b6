# What breaks between the emulated controllers and their bus, and in the controllers themselves: three axes on can0 and
# can1, which only the emulated machine has; another one's controllers may be in use. Their error counters are those of
# tests/vm/module. TAKT names the program, AFTER_A_STOP the example of that name.
[ "$TAKT_VM" != host ] || exit 0
. tests/vm/guest/faulted_run.sh
half=$folder/half.toml restarting=$folder/restarting.toml
restart_ms=150
with_folder configs/arm6-erob.toml "$folder/fast.toml"
with_long_moves "$folder/fast.toml" "$folder/arm.toml"
first_bus_only "$folder/arm.toml" > "$half"
without_first_move "$half"
sed "/^name = \"base\"/a restart_ms = $restart_ms" "$half" > "$restarting"

errors() { echo "$1 $2 $3" > /sys/module/error_counters/parameters/errors; } # INTERFACE transmit|receive|alone COUNT

# What the kernel says of an interface: its state, its error counters, how soon it restarts, its bit rate.
controller() { # INTERFACE
    ip -details -json link show "$1" | python3 -c '
import json, sys
data = json.load(sys.stdin)[0]["linkinfo"]["info_data"]
counters = data.get("berr_counter", {"tx": 0, "rx": 0})
print(data["state"], counters["tx"], counters["rx"], data.get("restart_ms", 0), data["bittiming"]["bitrate"])'
}

expect() { # SENTENCE WANTED FOUND
    if [ "$2" = "$3" ]; then passes "$1: $3"; else fails "$1: $3, and not $2"; fi
}

# The fault confinement state of the bus in the report of the last run.
reported_state() { python3 -c 'import json, sys; print(json.load(open(sys.argv[1]))["buses"][0]["state"])' "$folder/$name.json"; }

configured_by_takt() {
    ip link set can0 down
    begin "controller that is down when takt starts" 2 "$restarting" base=can0
    end borne
    expect "controller as takt has set it up (state, counters, restart, bit rate)" "ERROR-ACTIVE 0 0 $restart_ms 1000000" "$(controller can0)"
    interrupts_first
}

warned() {
    begin "controller at its warning level" 3 "$half" base=can0
    in_motion can0
    errors can0 transmit 12
    expect "controller after 12 errors" "ERROR-WARNING 96 0 $restart_ms 1000000" "$(controller can0)"
    errors can0 transmit -96
    end borne
}

passive() { # transmit|receive ERRORS
    begin "error-passive controller, errors on $1" 20 "$half" base=can0
    in_motion can0
    breaks_now
    errors can0 "$1" "$2"
    end bus_error_passive
    expect "$name, in the report" "error passive" "$(reported_state)"
    errors can0 "$1" -"$((8 * $2))"
}

# While another process replaces the queue of the interface, for some cycles, the kernel throws frames away. That may stop the axes; the drives
# are reached in either case.
frames_thrown_away() { # COMMAND...
    begin "frames thrown away by ${*:1:2}" 4 "$half" base=can0
    in_motion can0
    breaks_now
    "$@"
    end borne not_transmitted
    ! grep -q "has not confirmed" "$folder/$name.txt" || fails "$name: $(grep -m 1 "has not confirmed" "$folder/$name.txt")"
}

# told NAME WORDS: a run that cannot begin says so while it tries. It is interrupted when it has, after ten seconds at the latest.
told() {
    local attempt
    name=$1
    "$TAKT" run "$half" --bus base=can0 --duration 2 > "$folder/told.txt" 2>&1 & run=$!
    for attempt in $(seq 100); do
        ! grep -q "$2" "$folder/told.txt" || break
        kill -0 $run 2>/dev/null || break
        sleep 0.1
    done
    kill -INT $run 2>/dev/null
    if wait $run; then
        fails "$name: the run has found nothing wrong"
    elif grep -q "$2" "$folder/told.txt"; then
        passes "$name: $(grep -m 1 "$2" "$folder/told.txt")"
    else
        fails "$name: $(tail -n 1 "$folder/told.txt")"
    fi
}

begins_passive() {
    errors can0 transmit 16
    expect "controller before the run" "ERROR-PASSIVE 128 0 $restart_ms 1000000" "$(controller can0)"
    told "run that begins on an error-passive controller" "error-passive"
    errors can0 transmit -128
}

nobody_acknowledges() {
    errors can0 alone 1
    errors can0 transmit 16
    told "bus on which nobody acknowledges" "no node acknowledges a frame"
    errors can0 alone 0
    errors can0 transmit -128
}

unfit_mode() { # MODE
    ip link set can0 down
    ip link set can0 up type can bitrate 1000000 restart-ms $restart_ms "$1" on
    told "interface with $1" "$1 off"
    ip link set can0 down
    ip link set can0 up type can bitrate 1000000 restart-ms $restart_ms "$1" off
    interrupts_first
}

# How often the kernel has seen an interface leave its bus, and how often it has restarted it, since there were so many of each.
departures_and_restarts() { # INTERFACE DEPARTURES RESTARTS
    ip -details -statistics -json link show "$1" | python3 -c '
import json, sys
counts = json.load(sys.stdin)[0]["linkinfo"]["info_xstats"]
departures, restarts = map(int, sys.argv[1:])
print(counts["bus_off"] - departures, counts["restarts"] - restarts)' "${@:2}"
}

# 32 transmissions in a row without an acknowledgement. The controller is error-passive on the way, for some microseconds, and
# a cycle that begins just then stops for that. Its state afterwards is read when the run has ended: a restart may come before
# any program has started that could see the controller off its bus, and the kernel's counts do not miss it.
bus_off() { # NAME RESTARTS STATE
    local before
    begin "$1" 20 "$half" base=can0
    in_motion can0
    before=$(departures_and_restarts can0 0 0)
    breaks_now
    errors can0 transmit 32
    end bus_lost bus_error_passive
    expect "$name, departures and restarts" "1 $2" "$(departures_and_restarts can0 $before)"
    expect "$name, afterwards" "$3" "$(controller can0 | cut -d ' ' -f -3)"
}

moves_again() { # AFTER_WHAT
    begin "motion after $1" 2 "$half" base=can0
    end borne
}

# One process through it all: it stops, resets the fault, enables the axes again and goes on moving.
goes_on_after_bus_off() {
    name="program that goes on after bus-off"
    sed 's/^interface = "sim"/interface = "can0"/' "$restarting" > "$folder/goes_on.toml"
    chrt --other 0 "$AFTER_A_STOP" "$folder/goes_on.toml" 6 > "$folder/goes_on.txt" 2>&1 & run=$!
    in_motion can0
    errors can0 transmit 32
    wait $run
    if grep -q 'enabled again' "$folder/goes_on.txt" && grep -q '^Finished after 1 stop' "$folder/goes_on.txt"; then
        passes "$name: $(tail -n 1 "$folder/goes_on.txt")"
    else
        fails "$name: $(tail -n 1 "$folder/goes_on.txt")"
    fi
}

stays_off() {
    ip link set can0 down
    ip link set can0 up type can bitrate 1000000 restart-ms 0
    interrupts_first
    bus_off "bus-off without a restart" 0 "BUS-OFF 127 0"
    expect "$name, in the report" "bus off" "$(reported_state)"
    "$TAKT" doctor --self-test-s 0 --json > "$folder/doctor.json"
    expect "takt doctor on it (exit code, state, errors)" \
        "1 forbids_real_time bus-off; counters of the controller: 127 sending, 0 receiving" \
        "$? $(python3 -c '
import json, sys
checks = {c["check"]: c for c in json.load(open(sys.argv[1]))["checks"] if c["interface"] == "can0"}
print(checks["can_state"]["verdict"], checks["can_state"]["read"], end="; ")
print(", ".join(checks["can_errors"]["read"].split(", ")[:2]))' "$folder/doctor.json")"
    if "$TAKT" run "$half" --bus base=can0 --duration 2 > "$folder/refused.txt" 2>&1; then
        fails "takt run on a controller that is off the bus has found nothing wrong"
    elif grep -q 'ip link set can0 type can restart' "$folder/refused.txt"; then
        passes "takt run on it: $(tail -n 1 "$folder/refused.txt")"
    else
        fails "takt run on it does not say what mends it: $(tail -n 1 "$folder/refused.txt")"
    fi
    ip link set can0 type can restart
    moves_again "a restart by hand"
}

chrt --fifo --pid 1 $$ >/dev/null
busybox insmod "$OUT/../share/error_counters.ko" || exit
controllers_up
drives_on 40 "$half" can1
configured_by_takt
in_a_long_run warned
in_a_long_run passive transmit 16
in_a_long_run passive receive 128
for length in 100 64; do
    frames_thrown_away ip link set can0 txqueuelen $length
    frames_thrown_away tc qdisc replace dev can0 root pfifo limit $length
    tc qdisc del dev can0 root
done
begins_passive
nobody_acknowledges
unfit_mode listen-only
unfit_mode loopback
unfit_mode one-shot
bus_off "bus-off, restart after $restart_ms ms" 1 "ERROR-ACTIVE 0 0"
moves_again "bus-off and restart"
in_a_long_run goes_on_after_bus_off
in_a_long_run stays_off
in_a_long_run goes_down_and_up "controller down and up" "$half" can0 base=can0
in_a_long_run flood "flood of identifier 001 from the drives' controller" can1 "$half" base=can0
in_a_long_run flood "flood of identifier 001 from takt's controller" can0 "$half" base=can0
drives_off
exit $failed
