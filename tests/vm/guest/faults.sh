# What breaks on the wire and beside it, on the kernel's own interfaces: `takt run` in motion against `takt sim`, six axes
# on two virtual interfaces, and three on the emulated controllers where the emulation has them. One line a check; a check
# that fails says so in a sentence, and the others go on. TAKT names the program, SOAK_SECONDS says how long the soak lasts
# (600 is ten minutes). Leaves faults.txt, and in faults/ what every run printed and its black boxes.
#
# Every check is followed by another run on the same simulated drives: that they come back is proven with it.
. tests/vm/guest/laboratory.sh
soak_seconds=${SOAK_SECONDS:-20}
folder=$OUT/faults
mkdir -p "$folder"
fast=$folder/fast.toml arm=$folder/arm.toml half=$folder/half.toml
{ cat configs/arm6-erob.toml; printf '\n[telemetry]\ndirectory = "%s"\n' "$folder"; } > "$fast"
# Long moves, so that whatever happens does so in motion.
sed '/^\[\[program\.move\]\]/a minimum_duration = "6 s"' "$fast" > "$arm"
first_bus_only "$arm" > "$half"

failed=0
say() { echo "$*" | tee -a "$OUT/faults.txt"; }
passes() { say "ok    $*"; }
fails() { say "FAILS $*"; failed=1; }

run= name=
begin() { # NAME SECONDS CONFIG LEFT [RIGHT]
    name=$1
    chrt --other 0 "$TAKT" run "$3" --bus base="$4" ${5:+--bus wrist=$5} --require-realtime --duration "$2" --json \
        --record "$folder/$name.mcap" > "$folder/$name.json" 2> "$folder/$name.txt" & run=$!
}

# end RULE...: waits for the run and judges it by run_verdict.py.
end() {
    local status watch verdict
    # No run is longer from its fault on, or after the soak.
    { sleep 30; kill -KILL $run; } 2>/dev/null & watch=$!
    wait $run 2>/dev/null; status=$?
    kill $watch; wait $watch 2>/dev/null
    if verdict=$(python3 $guest/run_verdict.py "$TAKT" "$folder/$name.json" $status "$@" 2>&1); then
        passes "$name: $verdict"
    else
        fails "$name: $verdict; $(tail -n 1 "$folder/$name.txt")"
    fi
    rm -f "$folder/$name.mcap"
}

# Waits until the set-points of node 1 change from cycle to cycle, and then for the middle of the move.
in_motion() { # INTERFACE
    local tries
    for tries in $(seq 100); do
        [ "$(candump -L -T 500 -n 20 "$1,201:7FF" | cut -d ' ' -f 3 | sort -u | wc -l)" -gt 15 ] && { sleep 0.3; return; }
    done
    fails "$name: the axes have not begun to move"
}

# sdo_read INTERFACE NODE OBJECT: the four bytes of the answer as text; OBJECT is index and subindex as they stand in the frame.
sdo_read() {
    local frame
    exec 7< <(candump -L -T 1000 -n 1 "$1,58$2:7FF")
    sleep 0.05
    cansend "$1" "60$2#40${3}00000000"
    read -r _ _ frame <&7
    exec 7<&-
    echo "${frame:12:8}"
}
statusword=416000 position=646000

# Nothing is under power, which bit 2 of the statusword says, and nothing moves.
drives_at_rest() { # INTERFACE NODE...
    local interface=$1 node before word
    shift
    for node in "$@"; do
        word=$(sdo_read "$interface" "$node" $statusword)
        [ -n "$word" ] || { echo "node $node does not answer"; return 1; }
        [ $((0x${word:0:2} & 4)) = 0 ] || { echo "node $node is still enabled, statusword ${word:2:2}${word:0:2}"; return 1; }
        before=$(sdo_read "$interface" "$node" $position)
        sleep 0.1
        [ "$before" = "$(sdo_read "$interface" "$node" $position)" ] || { echo "node $node still moves"; return 1; }
    done
}

# While the kernel takes an interface down, it takes frames and drops them, some milliseconds before it says that the interface
# is down: set-points that are not confirmed may stop the group first.
goes_down_and_up() { # NAME CONFIG LOST LEFT [RIGHT]
    local lost=$3
    begin "$1" 20 "$2" "$4" ${5:-}
    in_motion "$4"
    ip link set "$lost" down
    sleep 0.3
    ip link set "$lost" up
    end bus_lost not_transmitted
}

# What a driver tells its listeners when the controller leaves the bus and when it comes back: CAN_ERR_BUSOFF and
# CAN_ERR_RESTARTED of linux/can/error.h, in error frames. The emulated controllers count no errors and acknowledge everything
# (QEMU's can_sja1000.c), so that they cannot leave the bus themselves.
goes_bus_off() { # NAME CONFIG LOST LEFT [RIGHT]
    local lost=$3
    begin "$1" 20 "$2" "$4" ${5:-}
    in_motion "$4"
    cansend "$lost" 20000040#0000000000000000
    sleep 0.1
    cansend "$lost" 20000100#0000000000000000
    end bus_lost
}

other_master() { # NAME INTERFACE FRAME
    begin "$1" 20 "$arm" vcan0 vcan1
    in_motion vcan0
    cansend "$2" "$3"
    end foreign_master
}

# The highest priority of all but NMT, as fast as somebody can send: borne, or a stop that says what became of the frames.
flood() { # NAME INTERFACE CONFIG LEFT [RIGHT]
    local flooded=$2 sender counter=/sys/class/net/$2/statistics/tx_packets before calm after frames
    begin "$1" 3 "$3" "$4" ${5:-}
    in_motion "$4"
    before=$(cat $counter)
    sleep 0.5
    calm=$(cat $counter)
    chrt --other 0 cangen "$flooded" -I 001 -L 8 -g 0 -i & sender=$!
    sleep 0.5
    after=$(cat $counter)
    kill $sender; wait $sender 2>/dev/null
    end borne not_transmitted missed_feedback node_lost timing_unfit
    frames=$((2 * (after - calm - (calm - before))))
    # The emulation imitates no wire; one of 1 Mbit/s could carry 8000 such frames.
    if [ $frames -gt 8000 ]; then
        passes "$name: $frames frames a second more than before went out on $flooded"
    else
        fails "$name: only $frames frames a second more than before went out on $flooded, which is no flood"
    fi
}

# Nobody is left to take the power away but the drives themselves: they miss the heartbeat of the master after 500 ms.
killed() {
    local word answer
    begin "kill -9" 20 "$arm" vcan0 vcan1
    in_motion vcan0
    kill -KILL $run; wait $run 2>/dev/null
    word=$(sdo_read vcan0 1 $statusword)
    sleep 1
    # A drive that has lost its master is stopped, where it answers nobody; the state of its power stays what it is.
    cansend vcan0 000#8000
    cansend vcan1 000#8000
    if [ -z "$word" ] || [ $((0x${word:0:2} & 4)) = 0 ]; then
        fails "$name: node 1 was not under power any more just afterwards (statusword ${word:2:2}${word:0:2}), so that this proves nothing"
    elif answer=$(drives_at_rest vcan0 1 2 3 && drives_at_rest vcan1 4 5 6); then
        passes "$name: under power just afterwards (statusword ${word:2:2}${word:0:2}); a second later all six drives have let go and stand still"
    else
        fails "$name: $answer"
    fi
    rm -f "$folder/$name.mcap"
}

resident_kib() { sed -n 's/^VmRSS:[[:space:]]*\([0-9]*\) kB/\1/p' "/proc/$1/status"; }

soak() {
    local early=0 late=0 now
    begin "soak of $soak_seconds s" "$soak_seconds" "$fast" vcan0 vcan1
    sleep 5
    early=$(resident_kib $run)
    while now=$(resident_kib $run 2>/dev/null) && [ -n "$now" ]; do
        late=$now
        sleep 0.5
    done
    end borne
    if [ "$late" -le "$early" ]; then
        passes "$name: $early KiB resident after 5 s, $late KiB at the end"
    else
        fails "$name: $early KiB were resident after 5 s, and $late KiB at the end"
    fi
}

chrt --fifo --pid 1 $$ >/dev/null
vcan_up vcan0
vcan_up vcan1
drives_on 70 "$arm" vcan0 vcan1
goes_down_and_up "interface down and up" "$arm" vcan1 vcan0 vcan1
goes_bus_off "bus-off and restart as a driver reports them" "$arm" vcan1 vcan0 vcan1
other_master "another master's SYNC" vcan0 080#
other_master "another master's NMT stop" vcan1 000#0200
flood "flood of identifier 001 on vcan0" vcan0 "$arm" vcan0 vcan1
killed
soak
drives_off

# Only the emulated machine has them; another one's controllers may be in use.
if [ "$TAKT_VM" != host ]; then
    controllers_up
    drives_on 40 "$half" can1
    goes_down_and_up "controller down and up" "$half" can0 can0
    goes_bus_off "controller's bus-off and restart as its driver reports them" "$half" can0 can0
    flood "flood of identifier 001 from the drives' controller" can1 "$half" can0
    flood "flood of identifier 001 from takt's controller" can0 "$half" can0
    drives_off
fi
exit $failed
