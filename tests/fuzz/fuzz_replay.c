/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Trace tables from anywhere: tests.csv, a zero byte, events.csv; then the test is played. */
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "replay.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

struct input {
    const uint8_t *data;
    size_t size;
};

static int load(void *const context, const char *const name, char **const text, size_t *const len,
                struct hm2_diag *const diag)
{
    (void)diag;
    const struct input *const input = context;
    const uint8_t *const cut = memchr(input->data, 0, input->size);
    const size_t first = cut ? (size_t)(cut - input->data) : input->size;
    const bool events = strcmp(name, "tests.csv") != 0;
    if (events && (strcmp(name, "events.csv") != 0 || !cut))
        return HM2_ERR_NOTFOUND;
    const uint8_t *const from = events ? cut + 1 : input->data;
    *len = events ? input->size - first - 1 : first;
    *text = malloc(*len + 1);
    if (!*text)
        return HM2_ERR_NOMEM;
    memcpy(*text, from, *len);
    (*text)[*len] = '\0';
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    static const char *const kinds[] = {"encoder", "pwmgen", "stepgen", "watchdog", "ioport", "hm2dpll"};
    if (size < 1)
        return 0;
    struct input input = {.data = data + 1, .size = size - 1};
    const struct replay_files files = {.load = load, .context = &input};
    const struct replay_options options = {0};
    struct replay_totals totals = {0};
    struct hm2_diag diag;
    hm2_diag_clear(&diag);
    (void)!replay_folder(kinds[data[0] % (sizeof(kinds) / sizeof(kinds[0]))], &files, &options, &totals, &diag);
    return 0;
}
