# Has independent CANopen software meet takt: the package `canopen` as the master of simulated drives, and as a slave. PYTHON names the
# environment's interpreter (tests/peers/prepare), TAKT the program; SUBJECTS may choose among them. Leaves a recording of every interface
# for tests/peers/decode.
. tests/vm/guest/laboratory.sh
recorders=()
for interface in vcan0 vcan1 vcan2 vcan3; do
    vcan_up $interface
    candump -L -r 4000000 $interface > "$OUT/peers-$interface.log" & recorders+=($!)
done
export TAKT PYTHONDONTWRITEBYTECODE=1
"$PYTHON" tests/peers/run.py ${SUBJECTS:-erob=vcan0 yz_aim=vcan1 slave=vcan2 data_sheets=vcan3}
status=$?
kill "${recorders[@]}"
wait "${recorders[@]}"
exit $status
