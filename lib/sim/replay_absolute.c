/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Encoders of the folders ssi, ssi_new, biss and fabs. Many of their tests list registers only; what the encoder of the
 * bench was told then stands in the description of the test, and the encoder is attached here.
 */
#include <stdlib.h>
#include <string.h>

#include "replay_trace.h"

#define PS_PER_NS       1000
#define BIT_PS_2048_KHZ 488281
#define PIN_DATA        0x03u

#define STARTED 0 /* word of run->state: starts so far */

struct value {
    unsigned bits;
    uint32_t words[4];
};

/* What the README of a folder says of its encoder. */
struct bench {
    const char *folder;
    uint8_t gtag;
    bool idle;
    struct sim_absolute usual;
};

static const struct bench benches[] = {
    {"ssi", HM2_GTAG_SSI, true, {.bits = 12, .value = {0x5A5}, .delay_ps = 50 * PS_PER_NS}},
    {"ssi_new", HM2_GTAG_SSI, true, {.bits = 16, .value = {0x9ABC}}},
    {"biss", HM2_GTAG_BISS, true, {.bits = 18, .value = {0x2A5C3}, .processing = 2}},
    {"fabs", HM2_GTAG_FABS, false, {.bits = 76, .value = {0x89ABCDE5, 0xFEDCBA98, 0xABC}, .delay_ps = 3000000}},
};

/* What no description gives: values of the first and the second transfer (0 bits: as usual), and the time after which
 * the encoder is ready again. */
static const struct {
    const char *folder, *test; /* beginning of its name */
    int64_t idle_ps;           /* 0 = as usual */
    struct value first, second;
} exceptions[] = {
    {"ssi", "read_while_busy", 1000000, {16, {0x1111}}, {16, {0x2222}}},
    {"ssi", "too_soon", 0, {16, {0x9ABC}}, {16, {0x9ABC}}},
    {"biss", "dav_start", 500000, {18, {0x2A5C3}}, {18, {0x15A3C}}},
    {"biss", "bits_512", 0, {120, {0xCCDDEEFF, 0x8899AABB, 0x44556677, 0x00112233}}, {0, {0}}},
    {"biss", "bits_", 0, {0, {0}}, {1, {0}}},
    {"biss", "delay_", 3000000, {0, {0}}, {0, {0}}},
    {"biss", "rate_", 3000000, {0, {0}}, {0, {0}}},
    {"fabs", "all0_all1", 0, {76, {0}}, {76, {UINT32_MAX, UINT32_MAX, 0xFFF}}},
    {"fabs", "read_while_busy", 0, {0, {0}}, {76, {0xCDEF0125, 0x456789AB, 0x123}}},
};

static const struct bench *bench_of(const struct replay_run *const run)
{
    for (size_t i = 0; i < sizeof benches / sizeof benches[0]; i++)
        if (strcmp(benches[i].folder, run->kind->folder) == 0)
            return &benches[i];
    return NULL;
}

/* ---- descriptions --------------------------------------------------------------------------------------------------
 */

/* Number in front of a text, "16" of "16 bits of"; -1 when the text is not there. */
static long number_before(const char *const description, const char *const text)
{
    const char *at = strstr(description, text);
    if (!at)
        return -1;
    while (at > description && at[-1] >= '0' && at[-1] <= '9')
        at--;
    char *end;
    const long number = strtol(at, &end, 10);
    return end != at && number >= 0 ? number : -1;
}

/* Number behind a text; -1 when there is none. */
static long number_after(const char *const description, const char *const text)
{
    const char *const at = strstr(description, text);
    char *end;
    if (!at)
        return -1;
    const long number = strtol(at + strlen(text), &end, 10);
    return end != at + strlen(text) && number >= 0 ? number : -1;
}

/* Up to 32 hexadecimal digits. */
static void parse_hex(const char *const text, uint32_t words[4])
{
    static const char digits[] = "0123456789ABCDEF";
    const size_t len = strspn(text, digits);
    memset(words, 0, 4 * sizeof words[0]);
    for (size_t i = 0; i < len && i < 32; i++)
        words[i / 8] |= (uint32_t)(strchr(digits, text[len - 1 - i]) - digits) << 4 * (i % 8);
}

static void describe_value(const char *const description, struct sim_absolute *const spec)
{
    const long wider = number_after(description, "encoder of ");
    const char *const separator = wider > 0 ? " bits " : " bits of ";
    const long bits = wider > 0 ? wider : number_before(description, separator);
    const char *const from = wider > 0 ? strstr(description, "encoder of ") : description;
    const char *const value = strstr(from, separator);
    if (bits <= 0 || bits > 128 || !value)
        return;
    spec->bits = (unsigned)bits;
    parse_hex(value + strlen(separator), spec->value);
}

static void describe_times(const char *const description, struct sim_absolute *const spec)
{
    static const char *const delays[] = {"encoder delay ", "line delay ", "encoder answers "};
    for (size_t i = 0; i < sizeof delays / sizeof delays[0]; i++) {
        const long ns = number_after(description, delays[i]);
        if (ns >= 0 && ns < 1000000 && strstr(description, " ns"))
            spec->delay_ps = ns * PS_PER_NS;
    }
    const long clocks = number_before(description, " clocks of processing"),
               bit_ps = number_after(description, "encoder bit time ");
    if (clocks >= 0 && clocks < 1000)
        spec->processing = (unsigned)clocks;
    if (bit_ps > 0 && bit_ps < 100000000)
        spec->bit_ps = bit_ps;
    if (strstr(description, "encoder at 2.048 MHz"))
        spec->bit_ps = BIT_PS_2048_KHZ;
}

/* ---- the test ------------------------------------------------------------------------------------------------------
 */

static bool recorded(const struct replay_run *const run)
{
    unsigned inputs = 0;
    for (size_t i = 0; i < run->test->count; i++) {
        const struct replay_event *const event = &run->trace->events[run->test->first + i];
        inputs += event->kind == 'I' && strcmp(event->name, "data") == 0;
    }
    return inputs > 1;
}

static int attach(const struct replay_run *const run, const struct bench *const bench, const bool second)
{
    struct sim_absolute spec = bench->usual;
    describe_value(run->test->description, &spec);
    describe_times(run->test->description, &spec);
    for (size_t i = 0; i < sizeof exceptions / sizeof exceptions[0]; i++) {
        if (strcmp(exceptions[i].folder, run->kind->folder) != 0 ||
            strncmp(exceptions[i].test, run->test->name, strlen(exceptions[i].test)) != 0)
            continue;
        const struct value *const value = second ? &exceptions[i].second : &exceptions[i].first;
        if (exceptions[i].idle_ps)
            spec.idle_ps = exceptions[i].idle_ps;
        if (value->bits) {
            spec.bits = value->bits;
            memcpy(spec.value, value->words, sizeof spec.value);
        }
        break;
    }
    return sim_card_absolute(run->card, bench->gtag, 0, &spec);
}

int replay_absolute_prepare(struct replay_run *const run)
{
    const struct bench *const bench = bench_of(run);
    if (!bench)
        return HM2_ERR_NOTFOUND;
    const bool stuck = strstr(run->test->description, "stuck") && !strstr(run->test->description, "channel");
    const bool level = stuck ? strstr(run->test->description, "stuck high") != NULL : bench->idle;
    const int err = sim_card_drive_input(run->card, -1, bench->gtag, 0, PIN_DATA, level ? SIM_HIGH : SIM_LOW);
    return err || stuck || recorded(run) ? err : attach(run, bench, false);
}

/* A second start: the encoder has another value by then. */
int replay_absolute_event(struct replay_run *const run, const struct replay_event *const event)
{
    const bool start = event->kind == 'W' && (strcmp(event->name, "data") == 0 || strcmp(event->name, "data0") == 0);
    if (!start || run->state[STARTED]++ != 1 || strstr(run->test->description, "stuck") || recorded(run))
        return 0;
    return attach(run, bench_of(run), true);
}
