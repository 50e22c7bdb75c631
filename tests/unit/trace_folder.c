/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "trace_folder.h"

#include "idrom_files.h"
#include "unit.h"

static int load(void *const context, const char *const name, char **const text, size_t *const len,
                struct hm2_diag *const diag)
{
    (void)diag;
    char path[512];
    snprintf(path, sizeof path, TEST_DATA "/%s/%s", (const char *)context, name);
    FILE *const there = fopen(path, "rb");
    if (!there)
        return HM2_ERR_NOTFOUND;
    fclose(there);
    *text = load_text(path, len);
    return 0;
}

static bool list(void *const context, const size_t index, char *const name, const size_t size)
{
    (void)context;
    (void)index;
    (void)name;
    (void)size;
    return false; /* no kind that is a unit test here asks for it */
}

static void on_result(void *const context, const char *const test, const bool passed, const char *const difference)
{
    if (!passed)
        print_error("%s/%s: %s\n", (const char *)context, test, difference);
}

struct replay_totals replay_data(const char *const name)
{
    char folder[64];
    snprintf(folder, sizeof folder, "%s", name);
    const struct replay_files files = {.load = load, .list = list, .context = folder};
    const struct replay_options options = {.on_result = on_result, .context = folder};
    struct replay_totals totals = {0};
    struct hm2_diag diag = {0};
    if (replay_folder(name, &files, &options, &totals, &diag))
        fail_msg("%s", diag.text);
    return totals;
}
