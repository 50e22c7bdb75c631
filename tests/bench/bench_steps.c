/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * User instructions of a driver in a realtime host that runs already, such as LinuxCNC's rtapi_app.
 *
 *     bench_steps PID READ WRITE CYCLES
 *
 * READ and WRITE are the addresses, in hexadecimal, of the functions that are called first and last in a cycle, as
 * `halcmd show funct` prints them.
 */
#include <stdio.h>
#include <stdlib.h>

#include "steps.h"

int main(const int argc, char **const argv)
{
    if (argc != 5) {
        fprintf(stderr, "usage: bench_steps PID READ WRITE CYCLES\n");
        return 2;
    }
    const struct step_code code = {.read = strtoul(argv[2], NULL, 16), .write = strtoul(argv[3], NULL, 16)};
    const int cycles = (int)strtol(argv[4], NULL, 10);
    struct step_counts counts = {0};
    const pid_t thread = steps_find((pid_t)strtol(argv[1], NULL, 10), code.read);
    if (thread < 0 || cycles < 1 || steps_count(thread, code, cycles, &counts) != 0) {
        perror("bench_steps");
        return 1;
    }
    steps_print(&counts);
    return 0;
}
