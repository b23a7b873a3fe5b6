# Six axes at 1 ms on two virtual interfaces, for SOAK_SECONDS (600 is ten minutes): nothing lost, no growth of memory,
# every anomaly accounted for. TAKT names the program.
. tests/vm/guest/faulted_run.sh
soak_seconds=${SOAK_SECONDS:-20}
arm=$folder/arm.toml
with_folder configs/arm6-erob.toml "$arm"

# Exact: VmRSS in /proc/PID/status is the sum of counters that each thread brings up to date after every 64th page fault, and
# may lag a megabyte behind (proc(5)).
resident_kib() { sed -n 's/^Rss:[[:space:]]*\([0-9]*\) kB/\1/p' "/proc/$1/smaps_rollup"; }
recorded_kib() { echo $(($(stat -c %s "$recording" 2>/dev/null || echo 0) / 1024)); }

soak() {
    local early late=0 now allowed=0
    begin "soak of $soak_seconds s" "$soak_seconds" "$arm" base=vcan0 wrist=vcan1
    # Until some ten seconds are recorded: twice what the black box keeps, so that every part has done its work several times.
    while kill -0 $run 2>/dev/null && [ "$(recorded_kib)" -lt 4096 ]; do sleep 0.2; done
    early=$(resident_kib $run)
    while now=$(resident_kib $run 2>/dev/null) && [ -n "$now" ]; do
        late=$now
        # An MCAP file ends with an index of its chunks, which is collected on the way: a thousandth of the file, in an
        # array that doubles. What else the heap holds is the same at any time (tests/allocation/memory.rs), but the pieces of a
        # chunk, 300 kB, and the blocks of the journal do not lie in it as those before did.
        allowed=$(($(recorded_kib) / 500 + 512))
        sleep 0.5
    done
    end borne nothing_lost
    if [ -n "$early" ] && [ "$late" -le $((early + allowed)) ]; then
        passes "$name: $early KiB resident after 4096 KiB of recording, $late KiB at the end; the recording may have taken $allowed KiB of that"
    else
        fails "$name: ${early:-no} KiB were resident after 4096 KiB of recording, and $late KiB at the end; the recording takes $allowed KiB at most"
    fi
}

chrt --fifo --pid 1 $$ >/dev/null
vcan_up vcan0
vcan_up vcan1
drives_on 70 "$arm" vcan0 vcan1
soak
drives_off
exit $failed
