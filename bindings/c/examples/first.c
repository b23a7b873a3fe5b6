/* The first program: moves the simulated joint to a quarter turn.
 *
 *   cc first.c $(pkg-config --cflags --libs takt) -o first && ./first configs/first.toml
 */
#include <stdio.h>
#include <takt.h>

int main(int count, char **arguments) {
    takt_handle arm;
    takt_motion motion;
    if (takt_open(count > 1 ? arguments[1] : "arm.toml", NULL, &arm) != TAKT_OK
        || takt_move_to(arm, (double[]){1.5708}, 1, NULL, &motion) != TAKT_OK
        || takt_wait(arm, motion, 10.0) != TAKT_OK || takt_close(arm) != TAKT_OK) {
        fprintf(stderr, "%s\n", takt_last_error_text());
        return 1;
    }
    puts("the joint is there");
    return 0;
}
