# Single drives commissioned from the command line: `takt drive` and `takt lss` against `takt sim` on virtual interfaces, an eRob
# on vcan0 and the servos of a gantry on vcan1. One line a check; a check that fails shows what was printed, and the others
# go on. TAKT names the program. Leaves commission.txt.
. tests/vm/guest/laboratory.sh
printed=$OUT/commission-printed.txt
failed=0
say() { echo "$*" | tee -a "$OUT/commission.txt"; }
passes() { say "ok    $*"; }
fails() { say "FAILS $*"; sed 's/^/      /' "$printed" | tee -a "$OUT/commission.txt"; failed=1; }

# judge NAME STATUS EXPECTED_STATUS PATTERN
judge() {
    if [ "$2" = "$3" ] && grep -Eq -- "$4" "$printed"; then passes "$1"; else fails "$1: exit $2, expected $3 with /$4/"; fi
}

# expect NAME STATUS PATTERN ARGUMENT...: takt with these arguments ends so and prints that.
expect() {
    local name=$1 status=$2 pattern=$3
    shift 3
    timeout 60 "$TAKT" "$@" > "$printed" 2>&1
    judge "$name" $? "$status" "$pattern"
}

# holds NAME CONDITION ARGUMENT...: takt with these arguments and --json ends with 0, and of its result `r` the condition holds.
holds() {
    local name=$1 condition=$2
    shift 2
    timeout 60 "$TAKT" "$@" --json > "$printed" 2>&1
    local status=$?
    python3 -c 'import json, sys
printed = json.load(open(sys.argv[1])); r = printed["result"]; sys.exit(not eval(sys.argv[2]))' "$printed" "$condition" 2>> "$printed" \
        && [ $status = 0 ] && passes "$name" || fails "$name: exit $status, or not $condition"
}

# interrupted NAME SECONDS PATTERN ARGUMENT...: Ctrl-C after so long ends takt with 130, and it prints that.
interrupted() {
    local name=$1 seconds=$2 pattern=$3
    shift 3
    "$TAKT" "$@" > "$printed" 2>&1 & local pid=$!
    sleep "$seconds"
    kill -INT $pid
    wait $pid
    judge "$name" $? 130 "$pattern"
}

for interface in vcan0 vcan1 vcan2; do vcan_up $interface; done
ip link set vcan2 down
"$TAKT" sim configs/single-erob.toml --bus can=vcan0 2> "$OUT/commission-erob.txt" & erob_sim=$!
"$TAKT" sim configs/gantry-yz-aim.toml --bus gantry=vcan1 2> "$OUT/commission-yz-aim.txt" & yz_sim=$!
sleep 1.5

erob=(drive --bus vcan0 --node 1 --family erob-canopen)
joint=(drive configs/single-erob.toml joint --bus can=vcan0)
yz=(drive --bus vcan1 --node 1 --family yz-aim)
x=(drive configs/gantry-yz-aim.toml x --bus gantry=vcan1)

expect "eRob by node: info" 0 'vendor ID +0x5A65726F' "${erob[@]}" info
expect "eRob by axis: info" 0 'vendor ID +0x5A65726F' "${joint[@]}" info
expect "eRob: enable and hold" 0 'state +switch on disabled' "${joint[@]}" enable --duration 0.3
holds "eRob: move to 10 deg" 'abs(r["position"] - 0.17453) < 1e-3 and r["state"] == "switch on disabled"' "${joint[@]}" move absolute "10 deg" --velocity "60 deg/s"
holds "eRob by node: 14564 counts back" 'abs(r["position_counts"]) < 200' "${erob[@]}" --raw move relative -14564 --velocity 100000 --acceleration 400000 --deceleration 400000
holds "eRob: reciprocate" 'abs(r["position"]) < 2e-3' "${joint[@]}" move reciprocate "5 deg" --times 2 --velocity "60 deg/s"
holds "eRob: run at 20 deg/s" 'r["travelled"] > 0.1 and r["state"] == "switch on disabled"' "${joint[@]}" velocity "20 deg/s" --duration 0.5
holds "eRob: push with -2 Nm" 'r["travelled"] < 0 and r["state"] == "switch on disabled"' "${joint[@]}" torque "-2 Nm" --duration 0.3
interrupted "eRob: Ctrl-C in the middle of a move" 1.5 'interrupted' "${joint[@]}" move absolute "170 deg" --velocity "20 deg/s"
holds "eRob: it has stopped on its way, without torque" 'abs(r["objects"][0]["raw"]) < 400 and 2000 < r["objects"][1]["raw"] < 200000 and r["objects"][2]["raw"] & 0x6F == 0x40' \
    "${erob[@]}" read 606C 6064 6041
expect "eRob: homing is refused" 2 'does not declare homing' "${joint[@]}" home
expect "eRob: another bit rate is refused" 2 'fixed at 1 Mbit/s' "${joint[@]}" set-bitrate "500 kbit/s"
expect "eRob: zero" 0 '.' "${joint[@]}" zero --yes
expect "eRob: save" 0 'stored' "${joint[@]}" save
expect "eRob: nothing to clear" 0 'none, nothing to clear' "${joint[@]}" clear-fault
expect "eRob: watch" 0 'switch on disabled' "${joint[@]}" watch --duration 0.5
[ "$(wc -l < "$printed")" -ge 5 ] && passes "eRob: watch shows several readings" || fails "eRob: watch shows several readings"

expect "YZ-AIM by node: info" 0 'vendor ID +0x00000331' "${yz[@]}" info
expect "YZ-AIM by axis: info" 0 'vendor ID +0x00000331' "${x[@]}" info
expect "YZ-AIM: enable and hold" 0 'state' "${x[@]}" enable --duration 0.3
holds "YZ-AIM: move to 20 mm" 'abs(r["position"] - 0.02) < 1e-4' "${x[@]}" move absolute "20 mm" --velocity "50 mm/s"
holds "YZ-AIM by node: one turn back" '30000 < r["position_counts"] < 35000' "${yz[@]}" --raw move relative -32768 --velocity 300
holds "YZ-AIM: run at 20 mm/s" 'r["travelled"] > 0.004' "${x[@]}" velocity "20 mm/s" --duration 0.5
expect "YZ-AIM: home" 0 'position after homing' "${x[@]}" home --method 17
expect "YZ-AIM: zero" 0 '.' "${x[@]}" zero --yes
expect "YZ-AIM: save" 0 'stored' "${x[@]}" save
expect "YZ-AIM: nothing to clear" 0 'none' "${x[@]}" clear-fault
expect "YZ-AIM: watch" 0 'not enabled' "${x[@]}" watch --duration 0.5
interrupted "YZ-AIM: Ctrl-C in the middle of a move" 1.5 'interrupted' "${x[@]}" move absolute "500 mm" --velocity "50 mm/s"
holds "YZ-AIM: it has stopped on its way" 'abs(r["objects"][0]["raw"]) < 20 and r["objects"][1]["raw"] < 1000000' "${yz[@]}" read 606C 6064

expect "an interface that is not there" 2 'there is no interface takt-none' drive --bus takt-none --node 1 --family yz-aim info
expect "a node that is not there" 1 'node 9 does not answer' drive --bus vcan0 --node 9 --family erob-canopen info
expect "another family than configured" 2 'is configured as' "${x[@]}" --family erob-canopen info
# Who may configure interfaces has it brought up by takt, and meets an empty bus.
expect "an interface that was down, with nobody on it" 1 'node 1 does not answer' drive --bus vcan2 --node 1 --family yz-aim info
ip link set vcan2 down
setpriv --reuid 65534 --clear-groups --inh-caps -all "$TAKT" drive --bus vcan2 --node 1 --family yz-aim info > "$printed" 2>&1
judge "an interface that is down, without the right to bring it up" $? 2 'to do so: sudo ip link set vcan2 up'
expect "LSS: no device without a node ID" 0 'no device without a node ID' lss --bus vcan0 scan
expect "LSS: no device to give a node ID to" 1 'no device without a node (number|ID) answers' lss --bus vcan1 set-id 5

kill $erob_sim $yz_sim
wait $erob_sim $yz_sim
exit $failed
