# From a call of each front to the wire, in cycles: the programs beside this folder call again and again and note when (front_calls.*), a
# listener sees SYNC and the set-points with the kernel's times, and front_latency.py counts. Three axes on a virtual interface, idle and
# under load, which begins with the calls. The first axis may accelerate so fast that the first cycle of a motion is more than a count of its
# encoder. TAKT, TAKT_ZENOH, PYTHON and ZENOH_PYTHON name programs; those of the fronts are in CALLS. ONLY=words calls only fronts with
# them in their call below. Leaves front_latency.txt. Fails when a call came to nothing, or could not be judged.
. tests/vm/guest/laboratory.sh
arm=$OUT/latency.toml
steep='velocity = "0.5 rad/s", acceleration = "400 rad/s^2", jerk = "1000000 rad/s^3"'
sed -e "/^name = \"joint1\"/,/^limits/s|velocity = .*jerk = \"[^\"]*\"|$steep|" -e '/^name = "base"/,/^interface/s/"sim"/"vcan0"/' \
    configs/arm6-erob.toml > "$OUT/arm.toml"
first_bus_only "$OUT/arm.toml" > "$arm"

failed=0 condition=
# What a front's own program has called, beside a listener.
called() { # NAME PROGRAM...
    case "$*" in *"${ONLY:-}"*) ;; *) return 0 ;; esac
    local name=$1 witness program status
    shift
    candump -L -r 4000000 vcan0,080:7FF,201:7FF > "$OUT/front.wire" & witness=$!
    chrt --fifo --pid 1 $witness
    "$@" > "$OUT/front.calls" 2> "$OUT/front.txt" & program=$!
    # Interpreters take minutes to begin under load.
    until grep -q 'calls begin' "$OUT/front.txt"; do kill -0 $program || break; sleep 0.1; done
    [ $condition = idle ] || load_on vcan0
    wait $program; status=$?
    load_off
    kill $witness; wait $witness
    echo "$name, $condition" | tee -a "$OUT/front_latency.txt"
    [ $status = 0 ] && python3 $guest/front_latency.py "$OUT/front.calls" "$OUT/front.wire" 2>> "$OUT/front.txt" | tee -a "$OUT/front_latency.txt"
    [ "$status ${PIPESTATUS[0]}" = "0 0" ] || { cat "$OUT/front.txt"; tail -n 3 "$OUT/front.calls" "$OUT/front.wire"; failed=1; }
}

served=$OUT/served
# The front in another process, beside `takt run --serve`.
beside_takt() { # PROGRAM...
    local run status
    chrt --other 0 "$TAKT" run "$arm" --serve "$served" > "$OUT/served.txt" 2>&1 & run=$!
    until grep -q 'served by the name' "$OUT/served.txt"; do kill -0 $run || { cat "$OUT/served.txt" >&2; return 1; }; sleep 0.1; done
    chrt --other 0 "$@"; status=$?
    kill -INT $run; wait $run
    return $status
}
over_zenoh() { # PROGRAM...
    local endpoint=tcp/127.0.0.1:7447 bridge status
    chrt --other 0 "$TAKT_ZENOH" "$served" --connect $endpoint --listen tcp/127.0.0.1:0 --domain 0 --command 2> "$OUT/bridge.txt" & bridge=$!
    "$@" $endpoint; status=$?
    # bash has its background processes ignore SIGINT, and the bridge leaves that as it is.
    kill $bridge; wait $bridge
    return $status
}
export -f over_zenoh
export served OUT

fronts() { # idle|load
    condition=$1
    called "Rust, a handle" chrt --other 0 "$CALLS/examples/front_calls" "$arm"
    called "another process" beside_takt "$CALLS/examples/front_calls" connect "$served"
    called "C" chrt --other 0 "$CALLS/front_calls_c" "$arm"
    called "C++" chrt --other 0 "$CALLS/front_calls_cpp" "$arm"
    called "ros2_control" chrt --other 0 "$CALLS/front_calls_ros2" "$arm"
    called "Python" chrt --other 0 "$PYTHON" tests/vm/front_calls.py "$arm"
    called "zenoh" beside_takt bash -c 'over_zenoh "$@"' zenoh "$ZENOH_PYTHON" tests/vm/front_calls_zenoh.py
}

chrt --fifo --pid 1 $$ >/dev/null
shorten_page_lists
vcan_up vcan0
drives_on 70 "$arm" vcan0
[ "${CONDITION:-}" = load ] || fronts idle
[ "${CONDITION:-}" = idle ] || fronts load
drives_off
exit $failed
