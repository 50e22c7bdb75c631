/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "mb2hal_peer.h"

#include <check.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define LIMIT_MS 60000
#define SKIP_MS  1000 /* halrun-user has said by then that it cannot */

static void write_text(const char *const folder, const char *const name, const char *const text, const mode_t mode)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *const file = fopen(path, "we");
    ck_assert_ptr_nonnull(file);
    fputs(text, file);
    ck_assert_int_eq(fclose(file), 0);
    ck_assert_int_eq(chmod(path, mode), 0);
}

/* Each pin is waited for by itself, so that a value need not stay. */
static void write_wait(const char *const folder, const struct mb2hal_pin *until)
{
    char text[4000];
    int length = snprintf(text, sizeof text, "#!/bin/sh\n");
    for (; until->name; until++)
        length += snprintf(text + length, sizeof text - (size_t)length,
                           "until [ \"$(halcmd getp %s)\" = %s ]; do sleep 0.1; done\n", until->name, until->value);
    length += snprintf(text + length, sizeof text - (size_t)length, "until [ -e %s/go ]; do sleep 0.1; done\n", folder);
    ck_assert_uint_lt((size_t)length, sizeof text);
    write_text(folder, "wait", text, 0755);
}

bool mb2hal_start(struct process *const halrun, const char *const folder, const char *const load,
                  const char *const config, const char *const commands, const struct mb2hal_pin *const until)
{
    char text[2000], file[256];
    snprintf(file, sizeof file, "%s/go", folder);
    (void)unlink(file); /* of a run before */
    write_wait(folder, until);
    snprintf(text, sizeof text, "%s config=%s/%s\n%sloadusr -w %s/wait\nshow pin\n", load, folder, config, commands,
             folder);
    write_text(folder, "peer.hal", text, 0644);
    snprintf(file, sizeof file, "%s/peer.hal", folder);
    const char *const argv[] = {TEST_SOURCE "/tests/system/halrun-user", file, NULL};
    process_start(halrun, argv);
    return !process_wait_end(halrun, SKIP_MS) || halrun->status != 77;
}

void mb2hal_finish(struct process *const halrun, const char *const folder)
{
    write_text(folder, "go", "", 0644);
    if (!process_wait_end(halrun, LIMIT_MS))
        ck_abort_msg("halrun does not end: %s", halrun->text);
}

/* Type, direction and value of a pin as "show pin" prints it, or false. */
static bool shown(const char *const line, char name[64], char rest[64])
{
    char type[16], dir[16], value[32], owner[16];
    if (sscanf(line, "%15s %15s %15s %31s %63s", owner, type, dir, value, name) != 5 ||
        strncmp(name, "mb2hal.", 7) != 0)
        return false;
    snprintf(rest, 64, "%s %s %s", type, dir, strstr(name, "num_errors") ? "" : value);
    return true;
}

static const char *next_line(const char *const line)
{
    const char *const end = strchr(line, '\n');
    return end ? end + 1 : NULL;
}

unsigned mb2hal_missing(const char *const pins, const char *const among)
{
    unsigned missing = 0, seen = 0;
    char name[64], rest[64], other_name[64], other_rest[64];
    for (const char *line = pins; line; line = next_line(line)) {
        if (!shown(line, name, rest))
            continue;
        bool found = false;
        seen++;
        for (const char *other = among; other && !found; other = next_line(other))
            found =
                shown(other, other_name, other_rest) && strcmp(name, other_name) == 0 && strcmp(rest, other_rest) == 0;
        if (!found)
            printf("%s: %s differs\n", name, rest);
        missing += !found;
    }
    if (seen < 10)
        ck_abort_msg("no list of pins: %s", pins);
    return missing;
}
