/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Trace folders from anywhere: the first byte chooses the kind, the rest is its files, with zero bytes between. What
 * can be read is played. */
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

/* Number of a file among those of its folder. */
static unsigned number_of(const char *const name)
{
    static const char *const first[] = {"tests.csv", "index.csv", "exchanges.csv"};
    for (size_t i = 0; i < sizeof(first) / sizeof(first[0]); i++)
        if (strcmp(name, first[i]) == 0)
            return 0;
    static const char *const third[] = {"measure.csv", "truth.csv", "excitation.csv"};
    for (size_t i = 0; i < sizeof(third) / sizeof(third[0]); i++)
        if (strcmp(name, third[i]) == 0)
            return 2;
    return 1;
}

static int load(void *const context, const char *const name, char **const text, size_t *const len,
                struct hm2_diag *const diag)
{
    (void)diag;
    const struct input *const input = context;
    const uint8_t *from = input->data;
    size_t left = input->size;
    for (unsigned number = number_of(name); number > 0; number--) {
        const uint8_t *const cut = left ? memchr(from, 0, left) : NULL;
        if (!cut)
            return HM2_ERR_NOTFOUND;
        left -= (size_t)(cut - from) + 1;
        from = cut + 1;
    }
    const uint8_t *const end = left ? memchr(from, 0, left) : NULL;
    *len = end ? (size_t)(end - from) : left;
    *text = malloc(*len + 1);
    if (!*text)
        return HM2_ERR_NOMEM;
    memcpy(*text, from, *len);
    (*text)[*len] = '\0';
    return 0;
}

static bool list(void *const context, const size_t index, char *const name, const size_t size)
{
    (void)context;
    if (index > 0 || size < 6)
        return false;
    memcpy(name, "a.hex", 6);
    return true;
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    static const char *const kinds[] = {"encoder", "encoder_muxed", "pwmgen",      "stepgen", "watchdog", "ioport",
                                        "hm2dpll", "idrom",         "lbp16",       "bspi",    "dbspi",    "spi",
                                        "uart",    "pktuart",       "pktuart_new", "tram",    "resolver"};
    if (size < 1)
        return 0;
    struct input input = {.data = data + 1, .size = size - 1};
    const struct replay_files files = {.load = load, .list = list, .context = &input};
    const struct replay_options options = {0};
    struct replay_totals totals = {0};
    struct hm2_diag diag;
    hm2_diag_clear(&diag);
    (void)!replay_folder(kinds[data[0] % (sizeof(kinds) / sizeof(kinds[0]))], &files, &options, &totals, &diag);
    return 0;
}
