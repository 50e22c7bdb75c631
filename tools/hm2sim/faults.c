/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "faults.h"

#include <string.h>

#include "words.h"

#define NS_PER_US 1e3
#define MAX_US    1e6

static bool read_us(const char *const text, const char **const end, int64_t *const ns)
{
    double us;
    if (!read_real(text, 0, MAX_US, end, &us))
        return false;
    *ns = (int64_t)(us * NS_PER_US);
    return true;
}

/* "US:US" */
static bool read_two_us(const char *const text, const char **const end, int64_t *const first_ns,
                        int64_t *const second_ns)
{
    return read_us(text, end, first_ns) && **end == ':' && read_us(*end + 1, end, second_ns);
}

/* "US" or "US-US" */
static bool take_delay(const char *const text, const char **const end, struct sim_faults *const f)
{
    if (!read_us(text, end, &f->delay_min_ns))
        return false;
    f->delay_max_ns = f->delay_min_ns;
    return **end != '-' || read_us(*end + 1, end, &f->delay_max_ns);
}

/* "P:US" */
static bool take_tail(const char *const text, const char **const end, struct sim_faults *const f)
{
    return read_real(text, 0, 1, end, &f->tail) && **end == ':' && read_us(*end + 1, end, &f->tail_ns);
}

static bool take_coalesce(const char *const text, const char **const end, struct sim_faults *const f)
{
    return read_us(text, end, &f->coalesce_ns);
}

static bool take_sleep(const char *const text, const char **const end, struct sim_faults *const f)
{
    return read_two_us(text, end, &f->sleep_ns, &f->wake_ns);
}

static bool take_busy(const char *const text, const char **const end, struct sim_faults *const f)
{
    return read_two_us(text, end, &f->busy_every_ns, &f->busy_ns);
}

static bool take_key(const char *const text, const char **const end, struct sim_faults *const f)
{
    static const struct {
        const char *key;
        bool (*take)(const char *text, const char **end, struct sim_faults *faults);
    } keys[] = {{"delay=", take_delay},
                {"tail=", take_tail},
                {"coalesce=", take_coalesce},
                {"sleep=", take_sleep},
                {"busy=", take_busy}};
    const struct {
        const char *key;
        double *probability;
    } chances[] = {{"loss=", &f->loss},
                   {"dup=", &f->duplicate},
                   {"reorder=", &f->reorder},
                   {"truncate=", &f->truncate},
                   {"foreign=", &f->foreign}};
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++)
        if (strncmp(text, keys[i].key, strlen(keys[i].key)) == 0)
            return keys[i].take(text + strlen(keys[i].key), end, f);
    for (size_t i = 0; i < sizeof chances / sizeof chances[0]; i++)
        if (strncmp(text, chances[i].key, strlen(chances[i].key)) == 0)
            return read_real(text + strlen(chances[i].key), 0, 1, end, chances[i].probability);
    return false;
}

int faults_option(const char *const text, struct sim_faults *const faults, struct hm2_diag *const diag)
{
    struct sim_faults f = {.seed = faults->seed};
    bool good = true;
    for (const char *at = strcmp(text, "none") == 0 ? "" : text; good && *at;) {
        good = take_key(at, &at, &f) && (*at == '\0' || (*at == ',' && at[1] != '\0'));
        at += good && *at == ',';
    }
    if (!good || sim_faults_check(&f))
        return hm2_diag_add(diag, HM2_ERR_INVALID,
                            "faults \"%s\": expected loss, dup, reorder, truncate, foreign = 0..1, delay = US[-US], "
                            "tail = 0..1:US, coalesce = US, sleep = US:US, busy = US:US (with the second not above the "
                            "first), in microseconds up to 1e6, separated by commas, or none",
                            text);
    *faults = f;
    return 0;
}
