# What breaks on the wire, on the kernel's own interfaces: `takt run` in motion against `takt sim`, six axes on two virtual
# interfaces. TAKT names the program.
#
# Every check is followed by another run on the same simulated drives: that they come back is proven with it.
. tests/vm/guest/faulted_run.sh
arm=$folder/arm.toml
with_folder configs/arm6-erob.toml "$folder/fast.toml"
with_long_moves "$folder/fast.toml" "$arm"
both="base=vcan0 wrist=vcan1"

other_master() { # NAME INTERFACE FRAME
    begin "$1" 20 "$arm" $both
    in_motion vcan0
    breaks_now
    cansend "$2" "$3"
    end foreign_master
}

chrt --fifo --pid 1 $$ >/dev/null
vcan_up vcan0
vcan_up vcan1
drives_on 70 "$arm" vcan0 vcan1
goes_down_and_up "interface down and up" "$arm" vcan1 $both
in_a_long_run other_master "another master's SYNC" vcan0 080#
in_a_long_run other_master "another master's NMT stop" vcan1 000#0200
flood "flood of identifier 001 on vcan0" vcan0 "$arm" $both
drives_off
exit $failed
