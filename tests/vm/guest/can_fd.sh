# CAN FD on a virtual interface: what takt says of one that takes no such frames, and whether the command that it names mends that; and
# the hollow-shaft motors of configs/hollow-leg-fd.toml, simulated, spoken to by hand (fd_by_hand.py). One line a check. A virtual
# interface has no bit rates, and the emulated SJA1000 no data phase. TAKT names the program. Leaves can_fd.txt.
. tests/vm/guest/laboratory.sh
failed=0
say() { echo "$*" | tee -a "$OUT/can_fd.txt"; }
passes() { say "ok    $*"; }
fails() { say "FAILS $*"; failed=1; }

leg=$OUT/leg.toml
sed '/^name = "can"/a interface = "vcan2"' configs/hollow-leg-fd.toml > "$leg"

# With a period at which three motors fit without bit-rate switching, too.
sed -e 's/^bit_rate_switch = true/bit_rate_switch = false/' -e '/^\[\[bus\]\]/i [cycle]\nperiod = "4 ms"\n' "$leg" > "$OUT/plain.toml"

# mended NAME COMMAND ARGUMENT...: takt with these arguments names the command, which is then carried out.
mended() {
    local name=$1 command=$2
    shift 2
    timeout 120 "$TAKT" "$@" > "$OUT/refused.txt" 2>&1
    if grep -qF "sudo $command" "$OUT/refused.txt" && $command; then
        passes "$name: $command"
    else
        fails "$name: no \"sudo $command\" in: $(tail -n 3 "$OUT/refused.txt")"
    fi
}

by_hand() { # NAME CONFIG plain|switching
    local name=$1 said
    "$TAKT" sim "$2" 2> "$OUT/sim.txt" & local sim=$!
    # Where the guest waits for the host's files, its time flies.
    until grep -q 'Ctrl-C' "$OUT/sim.txt"; do kill -0 $sim || break; sleep 0.1; done
    sleep 1
    if said=$(python3 $guest/fd_by_hand.py vcan2 "$3" 2>&1); then passes "$name: $said"; else fails "$name: $said"; fi
    kill $sim; wait $sim
}

vcan_up vcan2
mended "drives on an interface for classic frames" "ip link set vcan2 down" sim "$leg"
ip link set vcan2 mtu 72 up
ip link set vcan2 down
mended "an interface that is down, by takt doctor" "ip link set vcan2 mtu 72 up" doctor --self-test-s 0 "$leg"
ip link set vcan2 down
ip link set vcan2 mtu 16 up
mended "an interface for classic frames, by takt doctor" "ip link set vcan2 down" doctor --self-test-s 0 "$leg"
ip link set vcan2 mtu 72 up
by_hand "a motor without bit-rate switching" "$OUT/plain.toml" plain
by_hand "a motor with bit-rate switching" "$leg" switching
exit $failed
