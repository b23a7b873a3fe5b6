# Reads a candump log (candump -L) of one periodic frame and prints: frames, mean period, shortest, longest, range, largest deviation from
# the nominal period, missed slots; all times in microseconds. Run with -v nominal=1000 (microseconds).
# Seconds and microseconds are kept apart: as one number they would not fit a double's digits.
{
    split(substr($1, 2, length($1) - 2), time, ".")
    if (frames == 0) first_second = time[1]
    at = (time[1] - first_second) * 1000000 + time[2]
    if (frames == 0) first = at
    else {
        period = at - last
        deviation = period > nominal ? period - nominal : nominal - period
        if (frames == 1 || period < shortest) shortest = period
        if (frames == 1 || period > longest) longest = period
        if (deviation > largest) largest = deviation
        slots = int(period / nominal + 0.5)
        if (slots > 1) missed += slots - 1
    }
    last = at
    frames++
}
END {
    if (frames < 2) { print "fewer than two frames were recorded" > "/dev/stderr"; exit 1 }
    printf "%d %.4f %d %d %d %d %d\n", frames, (last - first) / (frames - 1), shortest, longest, longest - shortest, largest, missed
}
