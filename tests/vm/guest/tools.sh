# The tools of the bus on virtual interfaces: `takt scan` against `takt sim` and beside a running controller, `takt monitor` there, `takt send` as
# candump sees it, and refused on a bus with enabled axes. One line a check. TAKT names the program. Leaves tools.txt.
. tests/vm/guest/laboratory.sh
printed=$OUT/tools-printed.txt wire=$OUT/tools-wire.txt
failed=0
say() { echo "$*" | tee -a "$OUT/tools.txt"; }
passes() { say "ok    $*"; }
fails() { say "FAILS $*"; sed 's/^/      /' "$printed" | tee -a "$OUT/tools.txt"; failed=1; }

# expect NAME STATUS PATTERN ARGUMENT...: takt with these arguments ends so and prints that.
expect() {
    local name=$1 status=$2 pattern=$3 ended
    shift 3
    timeout 60 "$TAKT" "$@" > "$printed" 2>&1; ended=$?
    if [ $ended = "$status" ] && grep -Eq -- "$pattern" "$printed"; then
        passes "$name: $(grep -Em 1 -- "$pattern" "$printed")"
    else
        fails "$name: exit $ended, expected $status with /$pattern/"
    fi
}

# simulate CONFIG BUS=INTERFACE: drives, until they are ended.
simulators=()
simulate() {
    local log=$OUT/tools-sim-${#simulators[@]}.txt
    # As drives that have a processor of their own.
    chrt --fifo 70 "$TAKT" sim "$1" --bus "$2" 2> "$log" & simulators+=($!)
    until grep -q 'Ctrl-C' "$log"; do kill -0 "${simulators[-1]}" || break; sleep 0.1; done
}

vcan_up vcan0
vcan_up vcan1
vcan_up vcan2 72
simulate configs/single-erob.toml can=vcan0
simulate configs/gantry-yz-aim.toml gantry=vcan1
sleep 1

expect "scan: an eRob" 0 'servo drive \(CiA 402\) +ZeroErr' scan --bus vcan0 --to 16
expect "scan: the servos of a gantry" 0 'vcan1: 3 devices' scan --bus vcan1 --to 16
expect "scan: two buses" 0 'vcan1: 3 devices' scan --bus vcan0 --bus vcan1 --to 16
expect "scan: a silent bus" 0 'vcan2: nothing found' scan --bus vcan2
expect "scan: an interface that is not there" 2 'there is no interface vcan9' scan --bus vcan9
"$TAKT" scan --bus vcan0 --config > "$OUT/found.toml" 2> "$printed"
expect "scan --config: what takt check says of it" 0 '.' check "$OUT/found.toml"

# NMT, SYNC, process data and SDO writes are what a scan must not send; the drives send none of them.
candump -L vcan0 > "$wire" & listener=$!
sleep 0.2
"$TAKT" scan --bus vcan0 > "$printed" 2>&1
sleep 0.2
kill $listener; wait $listener 2>/dev/null
awk '{ split($3, f, "#"); is_read = f[2] ~ /^[4678]/ }
    f[1] ~ /^(000|080|[2345][0-7].)$/ || (f[1] ~ /^(6[0-3].|640)$/ && !is_read) || (f[1] ~ /^6[4-7][0-9A-F]$/ && f[1] != "640" && length(f[2]) > 8)' "$wire" > "$printed"
if [ ! -s "$printed" ] && [ "$(wc -l < "$wire")" -gt 128 ]; then
    passes "scan: $(wc -l < "$wire") frames, all of them reads and their answers"
else
    fails "scan: of $(wc -l < "$wire") frames these are no reads"
fi

# In narrow and wide terminals, without colours, and into a pipe that nobody reads to its end.
for columns in 60 80 200; do
    for arguments in "scan --bus vcan1 --to 4" "send 602#4000100000000000 --bus vcan1 --wait 0.2" "monitor --bus vcan1 --stats --duration 1"; do
        COLUMNS=$columns NO_COLOR=1 timeout 60 "$TAKT" $arguments > "$printed" 2>&1; ended=$?
        width=$(LC_ALL=C.UTF-8 wc -L < "$printed")
        if [ $ended = 0 ] && [ -s "$printed" ] && [ "$width" -le $columns ] && ! grep -q $'\e' "$printed"; then
            passes "in $columns columns: ${arguments%% *}, $width at most"
        else
            fails "in $columns columns: ${arguments%% *}, exit $ended, $width at most"
        fi
    done
done
for arguments in "scan --bus vcan1 --to 4" "scan --bus vcan1 --to 4 --json" "check configs/single-erob.toml" "send 080# --bus vcan1 --count 3"; do
    timeout 60 "$TAKT" $arguments 2> "$printed" | head -n 1 > /dev/null; ended=${PIPESTATUS[0]}
    if [ $ended = 0 ] && ! grep -q panicked "$printed"; then passes "into a closed pipe: $arguments"; else fails "into a closed pipe: $arguments, exit $ended"; fi
done

"$TAKT" run configs/single-erob.toml --bus can=vcan0 --duration 600 > "$OUT/tools-run.txt" 2>&1 & run=$!
until [ "$(candump -L -T 500 -n 20 vcan0,201:7FF | wc -l)" = 20 ]; do kill -0 $run || break; done
expect "scan beside a running controller is refused" 2 'has a master already.*--listen' scan --bus vcan0
expect "scan --listen beside a running controller" 0 'a master is active' scan --bus vcan0 --listen
expect "monitor beside a running controller" 0 'TPDO1|RPDO1' monitor --bus vcan0 --duration 1
expect "monitor --stats beside a running controller" 0 'SYNC' monitor --bus vcan0 --duration 1 --stats
expect "send beside a running controller is refused" 2 'has a master already.*--force' send '701#R' --bus vcan0
expect "send --force beside a running controller" 0 '701#R' send '701#R' --bus vcan0 --force
if kill -0 $run 2>/dev/null; then passes "the controller runs on"; else fails "the controller has ended"; cat "$OUT/tools-run.txt"; fi
kill -INT $run; wait $run

# One of the three servos belongs to a controller that is served: that asks the other two.
awk '/^\[\[axis\]\]/ { axes++ } /^\[\[program/ { exit } axes < 2' configs/gantry-yz-aim.toml > "$OUT/tools-one.toml"
"$TAKT" run "$OUT/tools-one.toml" --bus gantry=vcan1 --serve tools > "$OUT/tools-serve.txt" 2>&1 & run=$!
until "$TAKT" top --list | grep -q tools; do kill -0 $run || break; sleep 0.1; done
candump -L vcan1 > "$wire" & listener=$!
expect "scan beside a running controller that is served" 0 'node 3|^ +3 ' scan --bus vcan1 --to 16
expect "scan --json of the same" 0 '"answered": "not asked"' scan --bus vcan1 --to 16 --json
kill $listener; wait $listener 2>/dev/null
asked=$(grep -cE ' 60[23]#40' "$wire") own=$(grep -c ' 601#' "$wire")
if [ "$asked" -gt 0 ] && [ "$own" = 0 ]; then passes "scan: the drive of the controller was not asked"; else fails "scan: $asked questions to others, $own to its drive"; fi
if kill -0 $run 2>/dev/null; then passes "the controller runs on"; else fails "the controller has ended"; cat "$OUT/tools-serve.txt"; fi
kill -INT $run; wait $run

# A drive that is enabled, and no takt that commands it: its statusword is in its TPDO.
cangen vcan0 -g 20 -I 181 -L 8 -D 3716000000000000 & enabled=$!
expect "send on a bus with a drive that has torque is refused" 2 'has torque. Nothing was sent' send '601#4041600000000000' --bus vcan0
kill $enabled; wait $enabled 2>/dev/null

# seen NAME FRAME [ARGUMENT...]: candump sees this frame on vcan2, as takt was told.
seen() {
    local name=$1 text=$2
    shift 2
    candump -L -n "${frames:-1}" -T 2000 vcan2 > "$wire" & listener=$!
    sleep 0.2
    "$TAKT" send "$text" --bus vcan2 "$@" > "$printed" 2>&1
    wait $listener
    # Newer kernels mark each frame of CAN FD as one (flag 4).
    sed -i 's/##4/##0/; s/##5/##1/' "$wire"
    cat "$wire" >> "$printed"
    if [ "$(grep -cF " vcan2 $text" "$wire")" = "${frames:-1}" ]; then passes "$name: $text"; else fails "$name: $text"; fi
}
seen "a classic frame" '181#3712'
seen "a frame with 29 bits" '00000181#3712'
seen "a remote frame" '701#R'
seen "a frame of CAN FD" '123##0DEADBEEF' --data-bit-rate "5 Mbit/s"
seen "a frame of CAN FD with bit-rate switching" '123##1DEADBEEF' --data-bit-rate "5 Mbit/s"
frames=5 seen "a frame every 10 ms" '080#' --count 5 --period "10 ms"

# Who is not root, on an interface that is down: the command that mends it.
ip link set vcan2 down
setpriv --reuid 65534 --clear-groups --inh-caps -all "$TAKT" scan --bus vcan2 > "$printed" 2>&1
if [ $? = 2 ] && grep -q 'sudo ip link set vcan2' "$printed"; then passes "scan, not as root: $(tail -n 1 "$printed")"; else fails "scan, not as root"; fi

kill "${simulators[@]}"; wait "${simulators[@]}"
exit $failed
