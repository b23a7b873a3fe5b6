# takt itself: six axes on two interfaces, `takt sim` as the other side, SYNC seen by a listener of its own, idle and under load. TAKT names
# the program; CYCLES and LOAD_CYCLES set how long. Leaves product.txt (the table), jitter.txt (`takt jitter`), the recordings and the
# reports. Fails when the mean period drifts, a slot was missed, or the largest deviation is far above what cyclictest finds.
. tests/vm/guest/laboratory.sh
cycles=${CYCLES:-10000} load_cycles=${LOAD_CYCLES:-2000}
config=configs/arm6-erob.toml
# Beyond cyclictest's maximum, in microseconds. What remains is the kernel's: a timer of an ordinary thread that expires just before the slot
# holds the softirq lock for some ten microseconds, which sending a frame needs.
idle_allowance=5 load_allowance=25

row() { printf '%-18s %-8s %-5s %8s %11s %8s %8s %8s %10s %7s\n' "$@" | tee -a "$OUT/product.txt"; }

# The first and the last frame may each be early or late by the largest deviation: so much of the mean is not drift. In 60000 frames that is
# less than a nanosecond.
verdict() { # FRAMES MEAN DEVIATION MISSED LIMIT
    awk -v frames="$1" -v mean="$2" -v deviation="$3" -v missed="$4" -v limit="$5" 'BEGIN {
        drift = (mean - 1000) * (frames - 1)
        bad = (drift > 2 * deviation + 1 || drift < -2 * deviation - 1) ? "the mean period is off" : missed > 0 ? "a slot was missed" : \
            deviation > limit ? "the largest deviation is above " limit " us" : ""
        if (bad) { print "takt: " bad > "/dev/stderr"; exit 1 }
    }'
}

measure() { # idle|load CYCLES ALLOWANCE LEFT RIGHT
    local wake seconds found listener status
    read -r -a wake <<< "$(cyclictest_row 2000)"
    row "cyclictest wake-up" - "$1" 2000 "${wake[1]}" "${wake[0]}" "${wake[2]}" - - -
    # SYNC begins with the bring-up, so that the motion lasts longer than the recording.
    seconds=$(($2 / 1000 + 1))
    record "$4" "$2" "$OUT/takt-$1-$4.log" & listener=$!
    chrt --other 0 "$TAKT" run $config --bus base="$4" --bus wrist="$5" --require-realtime --duration $seconds \
        --record "$OUT/takt-$1-$4.mcap" > "$OUT/takt-$1-$4.txt" 2>&1
    status=$?
    rm -f "$OUT/takt-$1-$4.mcap"
    [ $status = 0 ] || { cat "$OUT/takt-$1-$4.txt"; kill $listener; return $status; }
    wait $listener
    read -r -a found <<< "$(periods "$OUT/takt-$1-$4.log" 1000)"
    row "takt SYNC" "$4" "$1" "${found[@]}"
    verdict "${found[0]}" "${found[1]}" "${found[5]}" "${found[6]}" $((wake[2] + $3))
}

drives=
drives_on() { # LEFT RIGHT
    chrt --fifo 70 "$TAKT" sim $config --bus base="$1" --bus wrist="$2" 2> "$OUT/sim.txt" & drives=$!
    sleep 1
}
drives_off() { kill "$drives"; wait "$drives"; }

chrt --fifo --pid 1 $$ >/dev/null
vcan_up vcan0
vcan_up vcan1
row "(microseconds)" bus load frames mean min max range deviation missed
"$TAKT" jitter --bus vcan0 --cycles 2000 > "$OUT/jitter.txt" 2>/dev/null || exit
sed -n 1,5p "$OUT/jitter.txt"
drives_on vcan0 vcan1
measure idle "$cycles" $idle_allowance vcan0 vcan1 || exit
load_on vcan0
measure load "$load_cycles" $load_allowance vcan0 vcan1 || exit
load_off
drives_off
