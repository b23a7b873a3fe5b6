# Who commands a bus: a second master is refused before its first frame, be the first one a takt of this host or a
# stranger, and takes over only when it is told to, after a controlled stop. Six axes on two virtual interfaces. TAKT
# names the program.
. tests/vm/guest/faulted_run.sh
arm=$folder/arm.toml
with_folder configs/arm6-erob.toml "$folder/fast.toml"
with_long_moves "$folder/fast.toml" "$arm"
both="base=vcan0 wrist=vcan1"
buses="--bus base=vcan0 --bus wrist=vcan1"
printed=$folder/refused.txt wire=$folder/wire.txt

# refused NAME PATTERN ARGUMENT...: takt with these arguments ends with 2 and prints that, and no NMT command, SDO or LSS
# request is on vcan0 meanwhile; a master in motion sends none.
refused() {
    local name=$1 pattern=$2 listener status
    shift 2
    candump -L vcan0,000:7FF,600:780,7E5:7FF > "$wire" & listener=$!
    sleep 0.1
    timeout 60 "$TAKT" "$@" > "$printed" 2>&1; status=$?
    sleep 0.1
    kill $listener; wait $listener 2>/dev/null
    if [ $status != 2 ] || ! grep -Eq -- "$pattern" "$printed"; then
        fails "$name: exit $status, expected 2 with /$pattern/: $(tail -n 1 "$printed")"
    elif [ -s "$wire" ]; then
        fails "$name: it was refused, and yet there was $(head -n 1 "$wire")"
    else
        passes "$name: $(tail -n 1 "$printed")"
    fi
}

# A value of the JSON report of a run.
of_report() { # NAME KEY...
    python3 -c 'import json, sys
value = json.load(open(sys.argv[1]))
for key in sys.argv[2:]: value = value[key]
print(value)' "$folder/$1.json" "${@:2}"
}

beside_a_running_one() {
    local holder="has a master already: process [0-9]+"
    # Twice as long as all of them take: each second of a run is ten of the machine that emulates it.
    begin "run that others try to disturb" 8 "$arm" $both
    in_motion vcan0
    refused "second takt run" "$holder.*--take-over" run "$arm" $buses --duration 1
    refused "takt run on one of its buses" "vcan1 $holder" run "$arm" --bus wrist=vcan1 --duration 1
    refused "takt drive move" "$holder.*--take-over" drive "$arm" joint1 --bus base=vcan0 move relative "1 deg"
    refused "takt drive disable" "$holder" drive --bus vcan0 --node 1 --family erob-canopen disable
    refused "takt drive info" "$holder" drive --bus vcan0 --node 1 --family erob-canopen info
    refused "takt lss scan" "$holder" lss --bus vcan0 scan
    refused "takt jitter" "$holder" jitter --bus vcan0 --cycles 10
    refused "second takt sim" "vcan0 has a simulator already" sim "$arm" $buses
    setpriv --reuid 65534 --clear-groups --inh-caps -all "$TAKT" run "$arm" $buses --take-over > "$printed" 2>&1
    if [ $? = 2 ] && grep -q "another user" "$printed"; then
        passes "take-over by another user: $(tail -n 1 "$printed")"
    else
        fails "take-over by another user was not refused: $(tail -n 1 "$printed")"
    fi
    end borne
}

# stranger NAME PATTERN IDENTIFIER DATA: something that sends this frame every ten milliseconds, and that no lock knows.
stranger() {
    local sender
    cangen vcan0 -I "$3" -L "$((${#4} / 2))" ${4:+-D "$4"} -g 10 & sender=$!
    sleep 0.1
    refused "$1" "another master is active on vcan0: $2" run "$arm" $buses --duration 1
    refused "$1, takt run --take-over" "another master is active on vcan0: $2" run "$arm" $buses --duration 1 --take-over
    kill $sender; wait $sender 2>/dev/null
}

taken_over() {
    local first="run that is taken over" status
    begin "$first" 60 "$arm" $both
    local first_pid=$run
    in_motion vcan0
    begin_take_over "run that takes over"
    wait $first_pid; status=$?
    local ended category
    ended=$(of_report "$first" ended) category=$(of_report "$first" stop category)
    if [ "$status $ended $category" = "130 taken_over 2" ] && [[ "$(of_report "$first" failure)" == "process $run "* ]]; then
        passes "$first: exit code 130, category 2, $(of_report "$first" failure)"
    else
        fails "$first: exit code $status, ended $ended, category $category; $(of_report "$first" failure)"
    fi
    rm -f "$recordings/$first.mcap"
    end borne
}
begin_take_over() { # NAME
    name=$1 fault_at=- recording=$recordings/$1.mcap
    chrt --other 0 "$TAKT" run "$arm" $buses --take-over --require-realtime --duration 2 --json --record "$recording" \
        > "$folder/$name.json" 2> "$folder/$name.txt" & run=$!
}

# The lock has gone with the process. The drives have come to rest by their own watchdogs.
after_kill() {
    begin "run that is killed" 20 "$arm" $both
    in_motion vcan0
    kill -KILL $run; wait $run 2>/dev/null
    rm -f "$recording"
    sleep 1
    begin "run after a kill -9 of another" 2 "$arm" $both
    end borne
}

chrt --fifo --pid 1 $$ >/dev/null
vcan_up vcan0
vcan_up vcan1
drives_on 70 "$arm" vcan0 vcan1
beside_a_running_one
stranger "stranger's SYNC" "SYNC \(identifier 080\)" 080 ""
in_a_long_run stranger "stranger's heartbeat" "the heartbeat of node 127, .* \(identifier 77F\)" 77F 05
in_a_long_run stranger "stranger's set-points" "set-points for node 1 \(identifier 201\)" 201 0F0000000000
taken_over
in_a_long_run after_kill
drives_off
exit $failed
