# What breaks beside the bus, on the kernel's own interfaces and file systems: recordings on a file system that hangs, is
# full, turns read-only or loses the file; a loaded disk; a process that is frozen, and one that is killed. TAKT names the
# program.
. tests/vm/guest/faulted_run.sh
arm=$folder/arm.toml gantry=$folder/gantry.toml
with_folder configs/arm6-erob.toml "$folder/fast.toml"
with_long_moves "$folder/fast.toml" "$arm"
with_folder configs/gantry-yz-aim.toml "$folder/fast-gantry.toml"
with_long_moves "$folder/fast-gantry.toml" "$gantry"
both="base=vcan0 wrist=vcan1"

# A file system of its own, on a disk that is a file in memory; recordings go there.
disk_on() { # SIZE
    recordings=/run/disk
    mkdir -p $recordings
    rm -f /run/disk.image
    truncate -s "$1" /run/disk.image
    mkfs.ext4 -q -F -O ^has_journal /run/disk.image && mount -o loop,errors=remount-ro /run/disk.image $recordings
}
disk_off() {
    umount $recordings
    recordings=$folder
}
begin_in_motion() { # NAME
    begin "$1" 4 "$arm" $both
    in_motion vcan0
}

disk_hangs() {
    disk_on 64M
    begin_in_motion "file system that hangs for a second"
    fsfreeze --freeze $recordings
    sleep 1
    fsfreeze --unfreeze $recordings
    end borne
    disk_off
}
disk_is_full() {
    disk_on 1M
    begin_in_motion "full file system"
    end borne records_lost
    disk_off
}
disk_turns_read_only() {
    disk_on 64M
    begin_in_motion "file system that turns read-only"
    echo 1 > /sys/fs/ext4/loop0/trigger_fs_error
    end borne records_lost
    disk_off
}
recording_is_removed() {
    disk_on 64M
    begin_in_motion "recording that is removed"
    rm "$recording"
    end borne records_lost
    disk_off
}
disk_is_loaded() {
    load_on vcan0
    begin_in_motion "loaded disk, processor and bus"
    end borne
    load_off
}

# The bucket of missed slots stops the group from 250 on, and the drives miss the heartbeat after 500 ms.
frozen() {
    begin "process that is frozen for 300 ms" 20 "$arm" $both
    in_motion vcan0
    breaks_now
    kill -STOP $run
    sleep 0.3
    kill -CONT $run
    end timing_unfit
}

# killed NAME CONFIG MOVING_IDENTIFIER BUS=INTERFACE=NODE,NODE...: nobody is left to stop the arm but the drives themselves,
# which miss the heartbeat of the master after 500 ms.
killed() {
    local label=$1 config=$2 moving=$3 bus buses=() watched=() found interface nodes answer
    shift 3
    for bus in "$@"; do
        buses+=("${bus%=*}")
        watched+=("${bus#*=}")
    done
    begin "$label" 20 "$config" "${buses[@]}"
    in_motion "${watched[0]%=*}" "$moving"
    python3 $guest/standstill.py "${watched[@]}" > "$folder/standstill.txt" 2>&1 & local witness=$!
    # It asks as soon as it listens: where the guest waits for the host's files, its time flies.
    candump -L -T 60000 -n 1 "${watched[0]%=*},601:7FF" > /dev/null
    sleep 0.5
    kill -KILL $run; wait $run 2>/dev/null
    if wait $witness; then
        found=($(cat "$folder/standstill.txt"))
        passes "$name: the last drive moved ${found[0]} ms after the last SYNC, and obeyed until ${found[1]} ms after it"
        stop_row "$name" "drive's own" - "${found[1]}" "${found[0]}"
    else
        fails "$name: $(tail -n 1 "$folder/standstill.txt")"
    fi
    # A drive of CiA 301 that has lost its master is stopped, where it answers nobody; the state of its power stays what it is.
    for bus in "${watched[@]}"; do
        interface=${bus%=*} nodes=${bus#*=}
        cansend "$interface" 000#8000
        answer=$(drives_at_rest "$interface" ${nodes//,/ }) || fails "$name: $answer"
    done
    rm -f "$recording"
}

gantry_is_left_alone() {
    vcan_up vcan2
    chrt --fifo 70 "$TAKT" sim "$gantry" --bus gantry=vcan2 2>> "$OUT/sim.txt" & drives=$!
    sleep 1
    killed "kill -9, YZ-AIM" "$gantry" 501 gantry=vcan2=1,2,3
    begin "motion of the same YZ-AIMs after it" 2 "$gantry" gantry=vcan2
    end borne
    drives_off
}

chrt --fifo --pid 1 $$ >/dev/null
vcan_up vcan0
vcan_up vcan1
drives_on 70 "$arm" vcan0 vcan1
in_a_long_run frozen
killed "kill -9, eRob" "$arm" 201 base=vcan0=1,2,3 wrist=vcan1=4,5,6
begin "motion of the same eRobs after it" 2 "$arm" $both
end borne
in_a_long_run disk_hangs
in_a_long_run disk_is_full
in_a_long_run disk_turns_read_only
in_a_long_run recording_is_removed
in_a_long_run disk_is_loaded
drives_off
in_a_long_run gantry_is_left_alone
exit $failed
