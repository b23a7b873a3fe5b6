# What the scripts of faults share: a run of takt in motion, the moment of the fault, and how it ended. To be sourced. A
# check that fails says so in a sentence, sets `failed`, and the others go on. Leaves faults.txt and stop_times.txt, and in
# faults/ what every run printed and its black boxes.
. tests/vm/guest/laboratory.sh
folder=$OUT/faults
mkdir -p "$folder"

failed=0
say() { echo "$*" | tee -a "$OUT/faults.txt"; }
passes() { say "ok    $*"; }
fails() { say "FAILS $*"; failed=1; }

# A row of the table of stop times.
stop_row() { # FAULT RULE CATEGORY NOTICED_MS REST_MS
    local row
    row=$(printf '%-56s %-18s %-8s %12s %12s' "$@")
    [ -s "$OUT/stop_times.txt" ] || printf '%-56s %-18s %-8s %12s %12s\n' "fault" rule category "noticed ms" "at rest ms" > "$OUT/stop_times.txt"
    echo "$row" >> "$OUT/stop_times.txt"
}

# with_folder CONFIG FILE: the same with its recordings and black boxes in `folder`.
with_folder() { { cat "$1"; printf '\n[telemetry]\ndirectory = "%s"\n' "$folder"; } > "$2"; }

# with_long_moves CONFIG FILE: so that whatever happens does so in motion. And without the first move, for every other run: a
# run that is broken off in mid-move leaves the arm nearer to its target, and the next would have less and less to go.
with_long_moves() {
    sed '/^\[\[program\.move\]\]/a minimum_duration = "6 s"' "$1" > "$2"
    without_first_move "$2"
}
without_first_move() { # FILE: leaves FILE.back
    awk -v RS= -v ORS='\n\n' '!(/^\[\[program\.move\]\]/ && !moves++)' "$1" > "$1.back"
}

# Where the next runs record to; their black boxes stay in `folder`.
recordings=$folder
is_back=0 run= name= fault_at=- recording=
begin() { # NAME SECONDS CONFIG BUS=INTERFACE...
    local config=$3 seconds=$2
    name=$1 fault_at=- recording=$recordings/$1.mcap
    shift 3
    [ ! -f "$config.back" ] || { is_back=$((1 - is_back)); [ $is_back = 0 ] || config=$config.back; }
    chrt --other 0 "$TAKT" run "$config" $(printf -- '--bus %s ' "$@") --require-realtime --duration "$seconds" --json \
        --record "$recording" > "$folder/$name.json" 2> "$folder/$name.txt" & run=$!
}

# To be called just before something breaks: on the clock of the recordings.
breaks_now() { fault_at=$EPOCHREALTIME; }

# end RULE...: waits for the run and judges it by run_verdict.py.
end() {
    local status watch verdict
    # No run is longer from its fault on, or after the soak.
    { sleep 30; kill -KILL $run; } 2>/dev/null & watch=$!
    wait $run 2>/dev/null; status=$?
    kill $watch; wait $watch 2>/dev/null
    if verdict=$(python3 $guest/run_verdict.py "$TAKT" "$folder/$name.json" $status "$fault_at" "$@" 2>&1); then
        passes "$name: ${verdict%%$'\n'*}"
        case $verdict in *$'\n'*) stop_row "$name" ${verdict##*$'\n'} ;; esac
    else
        fails "$name: $verdict; $(tail -n 1 "$folder/$name.txt")"
    fi
    rm -f "$recording"
}

# Waits until the set-points of node 1 change from cycle to cycle, and then for the middle of the move. For as long as the run
# lives: where the guest waits for the host's files, its time flies.
in_motion() { # INTERFACE [IDENTIFIER]
    while kill -0 $run 2>/dev/null; do
        [ "$(candump -L -T 500 -n 20 "$1,${2:-201}:7FF" | cut -d ' ' -f 3 | sort -u | wc -l)" -gt 15 ] && { sleep 0.3; return; }
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

# Nothing moves, and nothing is enabled, as bit 2 of the statusword says, but with bit 3: a YZ-AIM in an alarm shows both.
drives_at_rest() { # INTERFACE NODE...
    local interface=$1 node before word
    shift
    for node in "$@"; do
        word=$(sdo_read "$interface" "$node" $statusword)
        [ -n "$word" ] || { echo "node $node does not answer"; return 1; }
        [ $((0x${word:0:2} & 12)) != 4 ] || { echo "node $node is still enabled, statusword ${word:2:2}${word:0:2}"; return 1; }
        before=$(sdo_read "$interface" "$node" $position)
        sleep 0.1
        [ "$before" = "$(sdo_read "$interface" "$node" $position)" ] || { echo "node $node still moves"; return 1; }
    done
}

# goes_down_and_up NAME CONFIG LOST BUS=INTERFACE...
goes_down_and_up() {
    local name=$1 config=$2 lost=$3
    shift 3
    begin "$name" 20 "$config" "$@"
    in_motion "${1#*=}"
    breaks_now
    ip link set "$lost" down
    sleep 0.3
    ip link set "$lost" up
    end bus_lost
}

# The highest priority of all but NMT, as fast as somebody can send: borne, or a stop that says what became of the frames.
flood() { # NAME INTERFACE CONFIG BUS=INTERFACE...
    local name=$1 flooded=$2 config=$3 sender counters=/sys/class/net/$2/statistics before calm after others frames bits
    # All frames on the bus. On a virtual one everybody sends, and receives what it sends.
    counted() { case $flooded in vcan*) cat $counters/tx_packets ;; *) echo $(($(cat $counters/tx_packets) + $(cat $counters/rx_packets))) ;; esac; }
    shift 3
    begin "$name" 3 "$config" "$@"
    in_motion "${1#*=}"
    before=$(counted)
    sleep 0.5
    calm=$(counted)
    breaks_now
    # Ahead of all that is not real-time, the logger too.
    chrt --other 0 nice -n -20 cangen "$flooded" -I 001 -L 8 -g 0 -i & sender=$!
    sleep 0.5
    after=$(counted)
    kill $sender; wait $sender 2>/dev/null
    end borne not_transmitted missed_feedback node_lost timing_unfit
    others=$((2 * (calm - before))) frames=$((2 * (after - calm) - 2 * (calm - before)))
    # The emulation imitates no wire. One of 1 Mbit/s is more than full with this, even if no frame has a stuff bit: 111 bits with eight
    # bytes of data, 47 without data.
    bits=$((111 * frames + 47 * others))
    if [ $bits -gt 1000000 ]; then
        passes "$name: $frames frames a second beside $others others on $flooded"
    else
        fails "$name: only $frames frames a second beside $others others on $flooded, which is no flood"
    fi
}
