# Reads a candump log (candump -L) of SYNC, feedback and set-points of drives with one PDO each way, and says for each
# interface whether every set-point was on the wire in its slot, before the next SYNC, and after the same drive's feedback
# of that slot; and how long before; and how far SYNC of the buses is apart. Set-points count while they enable operation (bit 3 of the controlword that they
# begin with). Fails when one missed its slot, or was before the feedback. Run with -v period=1000 (microseconds).
# Seconds and microseconds are kept apart: as one number they would not fit a double's digits.
function digit(text, place) { return index("0123456789ABCDEF", substr(text, place, 1)) - 1 }
{
    split(substr($1, 2, length($1) - 2), time, ".")
    if (NR == 1) first_second = time[1]
    at = (time[1] - first_second) * 1000000 + time[2]
    bus = $2
    # CiA 301, 7.3.3: the upper four bits of an identifier are the function, the lower seven the node.
    function_code = digit($3, 1) * 2 + int(digit($3, 2) / 8)
    node = digit($3, 2) % 8 * 16 + digit($3, 3)
    axis = bus " " node
}
function_code == 1 && node == 0 {
    if (bus in sync && is_commanded[bus] && at - last_set_point[bus] < least_reserve[bus]) least_reserve[bus] = at - last_set_point[bus]
    if (!(bus in sync)) { least_reserve[bus] = period; latest_set_point[bus] = latest_feedback[bus] = set_points[bus] = 0 }
    if (latest_sync_on != "" && latest_sync_on != bus && at - sync[latest_sync_on] < period / 2 && at - sync[latest_sync_on] > furthest_apart) furthest_apart = at - sync[latest_sync_on]
    latest_sync_on = bus
    sync[bus] = at
    slot[bus]++
    is_commanded[bus] = 0
    next
}
!(bus in sync) { next }
function_code >= 3 && function_code <= 9 && function_code % 2 == 1 {
    feedback_slot[axis] = slot[bus]
    feedback_after = at - sync[bus]
    if (axis in last_slot && feedback_after > latest_feedback[bus]) latest_feedback[bus] = feedback_after
}
function_code >= 4 && function_code <= 10 && function_code % 2 == 0 && int(digit($3, 6) / 8) == 1 {
    set_points[bus]++
    if (!(axis in last_slot)) first_slot[axis] = slot[bus]
    else if (last_slot[axis] == slot[bus]) doubled[bus]++
    else missing[bus] += slot[bus] - last_slot[axis] - 1
    if (feedback_slot[axis] != slot[bus]) blind[bus]++
    if (!is_commanded[bus]) commanded[bus]++
    is_commanded[bus] = 1
    last_slot[axis] = slot[bus]
    last_set_point[bus] = at
    if (at - sync[bus] > latest_set_point[bus]) latest_set_point[bus] = at - sync[bus]
}
END {
    for (bus in sync) {
        printf "  %s: %d set-points in %d slots, %d missing, %d doubled, %d before their feedback; ", bus, set_points[bus], commanded[bus], missing[bus], doubled[bus], blind[bus]
        printf "SYNC + %d us the latest feedback, + %d us the latest set-point, %d us before the next SYNC\n", latest_feedback[bus], latest_set_point[bus], least_reserve[bus]
        bad += missing[bus] + doubled[bus] + blind[bus] + (set_points[bus] == 0)
    }
    if (length(sync) > 1) printf "  SYNC of the buses at most %d us apart\n", furthest_apart
    if (NR == 0 || bad) { print "wire: a set-point missed its slot, or feedback did" > "/dev/stderr"; exit 1 }
}
