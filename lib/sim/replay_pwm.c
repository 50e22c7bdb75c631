/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * measure.csv of a pwmgen folder: per row the registers, and what outputs A and B did in a window of some periods.
 * Where the window lay is not recorded, and with a rate of 65535/65536 a period is a count longer now and then; so a
 * row is met when somewhere in a long steady run of the card there is a stretch with just these periods, high times
 * and sums.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "replay_trace.h"
#include "sim_card.h"

#define MAX_EDGES      (1u << 18)
#define MAX_LISTED     8u
#define WINDOW_HCLK    (6 * 65536)
#define MAX_HCLK       (1 << 28)
#define CONSTANT_HCLK  16384 /* a level that lasts so long is called constant */
#define FIRST_CLK      12    /* registers are written every third clock from here on, as in events.csv */
#define ACCUMULATOR    65536
#define PDM_CYCLE      4096
#define MEASURE_OUTPUT 2u

struct edge {
    int64_t hclk;
    bool level;
};

struct output {
    struct edge *edges;
    size_t count;
    bool level_at_start;
    int watch;
};

struct measure {
    struct sim_card *card;
    struct output outputs[MEASURE_OUTPUT];
    int64_t start_clk, end_hclk;
    bool full;
};

struct expected {
    const char *state;
    int64_t periods[MAX_LISTED], highs[MAX_LISTED];
    unsigned period_count, high_count;
    int64_t high_sum, total; /* 0 = not given */
};

/* ---- the card's side ------------------------------------------------------------------------------------------------
 */

/* Number of the ClockHigh edge at or before a time. */
static int64_t hclk_of(const struct sim_card *const card, const int64_t clk, const unsigned ps)
{
    const double low_hz = sim_clock_low_hz(card), high_hz = sim_clock_high_hz(card);
    return (int64_t)((((double)clk + 0.5) / low_hz + ps * 1e-12) * high_hz - 0.5 + 1e-6);
}

static void on_edge(void *const context, const int64_t clk, const unsigned ps, const unsigned watch,
                    const enum sim_level level)
{
    struct measure *const m = context;
    for (unsigned i = 0; i < MEASURE_OUTPUT; i++) {
        struct output *const o = &m->outputs[i];
        if (o->watch != (int)watch)
            continue;
        if (clk < m->start_clk)
            o->level_at_start = level == SIM_HIGH;
        else if (o->count < MAX_EDGES)
            o->edges[o->count++] = (struct edge){hclk_of(m->card, clk, ps), level == SIM_HIGH};
        else
            m->full = true;
    }
}

struct registers {
    uint32_t mode, value, pwmrate, pdmrate;
};

/* ClockHigh cycles that a period can last at most. */
static int64_t longest_period(const struct registers *const r)
{
    const int64_t counts = (int64_t)1 << (9 + (r->mode & 3u) + (r->mode >> 2 & 1u));
    const int64_t pwm = r->pwmrate ? counts * ACCUMULATOR / (int64_t)r->pwmrate : 0;
    const int64_t pdm = r->pdmrate ? PDM_CYCLE * ACCUMULATOR / (int64_t)r->pdmrate : 0;
    const int64_t longest = (r->mode >> 3 & 3u) == 3 ? pdm : pwm;
    return longest < MAX_HCLK / 8 ? longest : MAX_HCLK / 8;
}

static int run_card(struct measure *const m, const struct replay_kind *const kind, const struct registers *const r,
                    struct hm2_diag *const diag)
{
    struct hm2_image image;
    if (!replay_firmware(kind->firmware, &image))
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "No firmware image %s.", kind->firmware);
    const struct sim_card_options options = {.profile = kind->profile, .image = &image};
    int err = sim_card_new(&m->card, &options, diag);
    for (unsigned i = 0; i < MEASURE_OUTPUT && !err; i++) {
        m->outputs[i].watch = sim_card_watch_output(m->card, HM2_GTAG_PWMGEN, 0, (uint8_t)(0x81 + i));
        m->outputs[i].edges = malloc(MAX_EDGES * sizeof(struct edge));
        err = m->outputs[i].watch < 0 ? m->outputs[i].watch : m->outputs[i].edges ? 0 : HM2_ERR_NOMEM;
    }
    if (err)
        return hm2_diag_add(diag, err, "The card cannot be measured.");
    sim_card_on_edge(m->card, on_edge, m);
    const uint32_t writes[][2] = {{0x4200, r->pwmrate}, {0x4300, r->pdmrate}, {0x4100, r->mode}, {0x4000, r->value}};
    const int64_t settling = longest_period(r);
    m->start_clk = FIRST_CLK + 100 + 2 * settling;
    for (unsigned i = 0; i < 4; i++)
        sim_card_write(m->card, FIRST_CLK + 3 * i, (uint16_t)writes[i][0], writes[i][1]);
    const int64_t window = 8 * settling > WINDOW_HCLK ? 8 * settling : WINDOW_HCLK;
    const int64_t end_clk = m->start_clk + window;
    for (int64_t clk = m->start_clk; clk < end_clk && !m->full; clk += 65536)
        sim_card_advance(m->card, clk + 65536 < end_clk ? clk + 65536 : end_clk);
    m->end_hclk = hclk_of(m->card, sim_card_clock(m->card), 0);
    return 0;
}

/* ---- the row's side -------------------------------------------------------------------------------------------------
 */

static int parse_list(const char *text, int64_t *const list, unsigned *const count)
{
    for (*count = 0; *text;) {
        char part[24];
        const size_t len = strcspn(text, ";");
        if (*count >= MAX_LISTED || len == 0 || len >= sizeof(part))
            return HM2_ERR_MALFORMED;
        memcpy(part, text, len);
        part[len] = '\0';
        const int err = replay_decimal(part, INT32_MAX, &list[(*count)++]);
        if (err)
            return err;
        text += len + (text[len] == ';');
    }
    return 0;
}

static int parse_sum(const char *const text, struct expected *const e)
{
    char part[24];
    if (!*text)
        return 0;
    const char *const slash = strchr(text, '/');
    if (!slash || (size_t)(slash - text) >= sizeof(part))
        return HM2_ERR_MALFORMED;
    snprintf(part, sizeof(part), "%.*s", (int)(slash - text), text);
    const int err = replay_decimal(part, INT32_MAX, &e->high_sum);
    return err ? err : replay_decimal(slash + 1, INT32_MAX, &e->total);
}

static int parse_output(const struct replay_csv *const csv, const char prefix, struct expected *const e,
                        struct hm2_diag *const diag)
{
    static const char *const suffixes[] = {"state", "period_hclk", "high_hclk", "high_sum"};
    const char *fields[4];
    for (unsigned i = 0; i < 4; i++) {
        char name[24];
        snprintf(name, sizeof(name), "%c_%s", prefix, suffixes[i]);
        const int column = replay_csv_need(csv, name, diag);
        if (column < 0)
            return column;
        fields[i] = csv->field[column];
    }
    *e = (struct expected){.state = fields[0]};
    if (parse_list(fields[1], e->periods, &e->period_count) || parse_list(fields[2], e->highs, &e->high_count) ||
        parse_sum(fields[3], e))
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "%s line %u: the values of output %c are not numbers.", csv->file,
                            csv->line, prefix);
    return 0;
}

static int parse_registers(const struct replay_csv *const csv, struct registers *const r, struct hm2_diag *const diag)
{
    const struct {
        const char *name;
        uint32_t *value;
    } rows[] = {{"mode_reg", &r->mode}, {"value_reg", &r->value}, {"pwmrate", &r->pwmrate}, {"pdmrate", &r->pdmrate}};
    for (unsigned i = 0; i < 4; i++) {
        const int column = replay_csv_need(csv, rows[i].name, diag);
        if (column < 0)
            return column;
        if (replay_hex32(csv->field[column], rows[i].value))
            return hm2_diag_add(diag, HM2_ERR_MALFORMED, "%s line %u: %s \"%.20s\" is not hex.", csv->file, csv->line,
                                rows[i].name, csv->field[column]);
    }
    return 0;
}

/* ---- comparison
 * ------------------------------------------------------------------------------------------------------ */

static unsigned position_in(const int64_t *const list, const unsigned count, const int64_t value)
{
    unsigned i = 0;
    while (i < count && list[i] != value)
        i++;
    return i;
}

static bool constant_somewhere(const struct measure *const m, const struct output *const o, const bool level)
{
    int64_t since = hclk_of(m->card, m->start_clk, 0);
    bool now = o->level_at_start;
    for (size_t i = 0; i < o->count; i++) {
        if (now == level && o->edges[i].hclk - since >= CONSTANT_HCLK)
            return true;
        since = o->edges[i].hclk;
        now = o->edges[i].level;
    }
    return now == level && m->end_hclk - since >= CONSTANT_HCLK;
}

static int64_t high_time(const struct output *const o, const size_t rise)
{
    return rise + 1 < o->count ? o->edges[rise + 1].hclk - o->edges[rise].hclk : 0;
}

/* Periods lo..hi of an output, one behind the other, with how often each expected value is among them. */
struct stretch {
    int64_t total, high_sum;
    unsigned periods[MAX_LISTED + 1], highs[MAX_LISTED + 1];
};

static void stretch_add(struct stretch *const s, const struct expected *const e, const int64_t period,
                        const int64_t high, const int sign)
{
    s->total += sign * period;
    s->high_sum += sign * high;
    s->periods[position_in(e->periods, e->period_count, period)] += (unsigned)sign;
    s->highs[position_in(e->highs, e->high_count, high)] += (unsigned)sign;
}

/* Every expected value is there, `also` counted in: the window may have ended with a pulse whose period is not whole.
 */
static bool stretch_complete(const struct stretch *const s, const struct expected *const e, const int64_t also)
{
    const unsigned extra = position_in(e->highs, e->high_count, also);
    for (unsigned i = 0; i < e->period_count; i++)
        if (!s->periods[i])
            return false;
    for (unsigned i = 0; i < e->high_count; i++)
        if (!s->highs[i] && i != extra)
            return false;
    return !e->total || (s->total == e->total && s->high_sum == e->high_sum);
}

/* Somewhere there is a stretch of whole periods with just the expected values. */
static bool stretch_fits(const struct output *const o, const struct expected *const e)
{
    const size_t first = o->count && !o->edges[0].level ? 1 : 0;
    struct stretch s = {0};
    for (size_t lo = first, hi = first; hi + 2 < o->count; hi += 2) {
        const int64_t period = o->edges[hi + 2].hclk - o->edges[hi].hclk;
        stretch_add(&s, e, period, high_time(o, hi), 1);
        if (s.periods[e->period_count] || s.highs[e->high_count]) {
            s = (struct stretch){0};
            lo = hi + 2;
            continue;
        }
        for (; e->total && s.total > e->total; lo += 2)
            stretch_add(&s, e, o->edges[lo + 2].hclk - o->edges[lo].hclk, high_time(o, lo), -1);
        if (stretch_complete(&s, e, high_time(o, hi + 2)))
            return true;
    }
    return false;
}

static bool high_time_seen(const struct output *const o, const struct expected *const e)
{
    unsigned seen = 0;
    for (size_t i = 0; i + 1 < o->count; i++)
        if (o->edges[i].level)
            seen |= 1u << position_in(e->highs, e->high_count, o->edges[i + 1].hclk - o->edges[i].hclk);
    return (seen & ((1u << e->high_count) - 1)) == (1u << e->high_count) - 1;
}

static bool output_fits(const struct measure *const m, const struct output *const o, const struct expected *const e)
{
    if (strcmp(e->state, "const0") == 0 || strcmp(e->state, "const1") == 0)
        return constant_somewhere(m, o, e->state[5] == '1');
    if (o->count == 0)
        return false;
    if (e->period_count == 0)
        return high_time_seen(o, e);
    return stretch_fits(o, e);
}

static void describe(const struct measure *const m, const char name, const struct output *const o,
                     const struct expected *const e, const unsigned line, char *const text, const size_t size)
{
    int64_t high = 0, period = 0;
    for (size_t i = 0; i + 2 < o->count && !period; i++)
        if (o->edges[i].level) {
            high = o->edges[i + 1].hclk - o->edges[i].hclk;
            period = o->edges[i + 2].hclk - o->edges[i].hclk;
        }
    snprintf(text, size,
             "hclk %lld..%lld: %c expected %s period %lld high %lld (line %u), got %zu edges, first period %lld high "
             "%lld",
             (long long)hclk_of(m->card, m->start_clk, 0), (long long)m->end_hclk, name, e->state,
             e->period_count ? (long long)e->periods[0] : 0, e->high_count ? (long long)e->highs[0] : 0, line, o->count,
             (long long)period, (long long)high);
}

static int measure_row(const struct replay_kind *const kind, const struct replay_csv *const csv, char *const difference,
                       struct hm2_diag *const diag)
{
    struct registers registers;
    struct expected expected[MEASURE_OUTPUT];
    struct measure m = {0};
    int err = parse_registers(csv, &registers, diag);
    for (unsigned i = 0; i < MEASURE_OUTPUT && !err; i++)
        err = parse_output(csv, (char)('A' + (int)i), &expected[i], diag);
    if (!err)
        err = run_card(&m, kind, &registers, diag);
    for (unsigned i = 0; i < MEASURE_OUTPUT && !err && !difference[0]; i++)
        if (!output_fits(&m, &m.outputs[i], &expected[i]))
            describe(&m, (char)('A' + (int)i), &m.outputs[i], &expected[i], csv->line, difference, REPLAY_TEXT);
    for (unsigned i = 0; i < MEASURE_OUTPUT; i++)
        free(m.outputs[i].edges);
    sim_card_free(m.card);
    return err;
}

int replay_pwm_measure(const struct replay_kind *const kind, const struct replay_files *const files,
                       const struct replay_options *const options, struct replay_totals *const totals,
                       struct hm2_diag *const diag)
{
    char *text = NULL;
    size_t len = 0;
    struct replay_csv csv;
    int err = files->load(files->context, "measure.csv", &text, &len, diag);
    if (err)
        return err == HM2_ERR_NOTFOUND ? 0 : err;
    err = replay_csv_open(&csv, "measure.csv", text, len, diag);
    while (!err) {
        const int got = replay_csv_row(&csv, diag);
        if (got <= 0) {
            err = got;
            break;
        }
        char name[32], difference[REPLAY_TEXT] = "";
        snprintf(name, sizeof(name), "measure_%03u", csv.line);
        if (!replay_wanted(options, name))
            continue;
        err = measure_row(kind, &csv, difference, diag);
        if (!err)
            replay_report(options, totals, name, difference);
    }
    free(text);
    return err;
}
