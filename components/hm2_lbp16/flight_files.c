/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "flight_files.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

/* A file of this name from an earlier run is not written over. */
static FILE *create(const char *const folder, const char *const card, char *const path, const size_t size)
{
    FILE *file = NULL;
    errno = EEXIST;
    for (unsigned number = 0; number < FLIGHT_FILES_MAX && !file && errno == EEXIST; number++) {
        const int len = snprintf(path, size, "%s/%s-%02u.flight", folder, card, number);
        if (len < 0 || (size_t)len >= size) {
            errno = ENAMETOOLONG;
            return NULL;
        }
        file = fopen(path, "wxe");
    }
    return file;
}

static bool write_cycles(FILE *const file, const struct hm2_board *const board,
                         const struct hm2_flight_head *const head, const unsigned count)
{
    char line[2 * HM2_FLIGHT_LINE_SIZE];
    (void)hm2_flight_format_head(head, line);
    bool good = fputs(line, file) >= 0;
    for (unsigned i = 0; i < count && good; i++) {
        const struct hm2_flight_cycle cycle = hm2_board_flight_cycle(board, i);
        (void)hm2_flight_format_cycle(&cycle, line);
        good = fputs(line, file) >= 0;
    }
    return fclose(file) == 0 && good;
}

bool flight_file_write(struct hm2_board *const board, const char *const folder, char *const text, const size_t size)
{
    char path[384];
    struct hm2_flight_head head;
    const unsigned count = hm2_board_flight(board, &head);
    if (count == 0)
        return false;
    FILE *const file = create(folder, head.card, path, sizeof path);
    if (!file && errno == EEXIST)
        (void)snprintf(text, size,
                       "%s: the flight recorder stopped for %s; %s has %u files already, so it is not written",
                       head.card, hm2_flight_cause_name(head.cause), folder, FLIGHT_FILES_MAX);
    else if (!file || !write_cycles(file, board, &head, count))
        (void)snprintf(text, size, "%s: the flight recorder stopped for %s, but %s cannot be written: %s", head.card,
                       hm2_flight_cause_name(head.cause), path, strerror(errno));
    else
        (void)snprintf(text, size, "%s: the flight recorder stopped for %s; %u cycles are in %s (hm2trace shows them)",
                       head.card, hm2_flight_cause_name(head.cause), count, path);
    hm2_board_flight_resume(board);
    return true;
}
