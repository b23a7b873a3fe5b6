# Six axes at 1 ms on two virtual interfaces, for SOAK_SECONDS (600 is ten minutes): nothing lost, no growth of memory,
# every anomaly accounted for. TAKT names the program.
. tests/vm/guest/faulted_run.sh
soak_seconds=${SOAK_SECONDS:-20}
arm=$folder/arm.toml
with_folder configs/arm6-erob.toml "$arm"

resident_kib() { sed -n 's/^VmRSS:[[:space:]]*\([0-9]*\) kB/\1/p' "/proc/$1/status"; }

soak() {
    local early=0 late=0 now index
    begin "soak of $soak_seconds s" "$soak_seconds" "$arm" base=vcan0 wrist=vcan1
    sleep 5
    early=$(resident_kib $run)
    while now=$(resident_kib $run 2>/dev/null) && [ -n "$now" ]; do
        late=$now
        # An MCAP file ends with an index of its chunks, which is collected on the way: a thousandth of the file, kept in
        # arrays that double. Without a recording nothing grows at all.
        index=$(($(stat -c %s "$recording") / 1024 / 500))
        sleep 0.5
    done
    end borne nothing_lost
    if [ "$late" -le $((early + index)) ]; then
        passes "$name: $early KiB resident after 5 s, $late KiB at the end, of which at most $index KiB are the recording's index"
    else
        fails "$name: $early KiB were resident after 5 s, and $late KiB at the end; the recording's index takes $index KiB at most"
    fi
}

chrt --fifo --pid 1 $$ >/dev/null
vcan_up vcan0
vcan_up vcan1
drives_on 70 "$arm" vcan0 vcan1
soak
drives_off
exit $failed
