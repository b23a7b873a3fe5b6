# Reads a candump log (candump -L) of drives that answer each request by one reply, and says whether every drive had one request in
# every slot, and one reply to it before the next; and how far the requests of a slot are apart, and how long the replies took, but for
# those to the last requests: the end of a program holds the drives' up. Run with -v requests="001 002" -v replies="065 066", the
# identifiers drive by drive. A slot begins with a request to the first of them. Fails when a request or a reply is missing, or there
# was one too many.
# Seconds and microseconds are kept apart: as one number they would not fit a double's digits.
BEGIN {
    drives = split(requests, ids, " ")
    for (drive in ids) request_to[ids[drive]] = drive
    split(replies, ids, " ")
    for (drive in ids) reply_of[ids[drive]] = drive
}
function ends_slot(is_last, drive) {
    for (drive = 1; drive <= drives; drive++) {
        if (!asked[drive]) missing++
        if (!answered[drive]) unanswered++
        else if (!is_last && (shortest == "" || took[drive] < shortest)) shortest = took[drive]
        if (!is_last && took[drive] > longest) longest = took[drive]
        asked[drive] = answered[drive] = 0
    }
}
{
    split(substr($1, 2, length($1) - 2), time, ".")
    if (NR == 1) first_second = time[1]
    at = (time[1] - first_second) * 1000000 + time[2]
    id = $3
    sub(/#.*/, "", id)
}
id in request_to {
    drive = request_to[id]
    if (drive == 1) {
        if (slots++) ends_slot(0)
        slot_at = at
    }
    if (asked[drive]) doubled++
    asked[drive] = 1
    asked_at[drive] = at
    if (at - slot_at > furthest_apart) furthest_apart = at - slot_at
}
id in reply_of {
    drive = reply_of[id]
    if (!asked[drive] || answered[drive]) unasked++
    answered[drive] = 1
    took[drive] = at - asked_at[drive]
}
END {
    if (slots) ends_slot(1)
    printf "  requests of %d drives in %d slots: %d missing, %d doubled, %d unanswered, %d replies that were not asked for; ", drives, slots, missing, doubled, unanswered, unasked
    printf "those of a slot at most %d us apart, replies after %d to %d us\n", furthest_apart, shortest, longest
    if (!slots || missing + doubled + unanswered + unasked) { print "requests: a drive missed one, or its reply" > "/dev/stderr"; exit 1 }
}
