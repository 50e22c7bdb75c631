/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "absolutes.h"

#include <ctype.h>
#include <limits.h>
#include <math.h>
#include <string.h>

#include "words.h"

#define PS_PER_NS  1000
#define NS_PER_S   1e9
#define WORDS      4u
#define WORD_BITS  32u
#define MAX_BITS   128u
#define MAX_FIELD  64u
#define MAX_NS     1000000 /* of delays */
#define DELAY_PS   100000  /* of drivers and cable: an SSI reader misses an answer within its clock */
#define MAX_CLOCKS 1000u   /* that BISS encoders process for */
#define MAX_SPEED  1e9
#define WRAPS_AT   0x1p62 /* no position is so far from the start */

static const struct {
    const char *name;
    uint8_t gtag;
} kinds[] = {{"ssi.", HM2_GTAG_SSI}, {"biss.", HM2_GTAG_BISS}, {"fanuc.", HM2_GTAG_FABS}};

/* ---- options ----------------------------------------------------------------------------------------------------- */

static bool take_bits(const char *const text, const char **const end, struct absolute_encoder *const e)
{
    unsigned long bits;
    if (!read_unsigned(text, MAX_BITS, end, &bits) || bits == 0)
        return false;
    e->data.bits = (unsigned)bits;
    return true;
}

/* Hexadecimal, up to 32 digits, with 0x or without. */
static bool take_value(const char *text, const char **const end, struct absolute_encoder *const e)
{
    text += strncmp(text, "0x", 2) == 0 ? 2 : 0;
    const size_t digits = strspn(text, "0123456789abcdefABCDEF");
    *end = text + digits;
    memset(e->data.value, 0, sizeof e->data.value);
    for (size_t i = 0; i < digits && digits <= MAX_BITS / 4; i++) {
        const char c = (char)tolower((unsigned char)text[digits - 1 - i]);
        const uint32_t nibble = c <= '9' ? (uint32_t)(c - '0') : (uint32_t)(c - 'a') + 10u;
        e->data.value[i / 8] |= nibble << i % 8 * 4;
    }
    return digits > 0 && digits <= MAX_BITS / 4;
}

/* AT:WIDTH[g] */
static bool take_field(const char *const text, const char **const end, struct absolute_field *const f)
{
    unsigned long at, width;
    if (!read_unsigned(text, MAX_BITS - 1, end, &at) || **end != ':' ||
        !read_unsigned(*end + 1, MAX_FIELD, end, &width) || width == 0)
        return false;
    f->at = (unsigned)at;
    f->width = (unsigned)width;
    f->gray = **end == 'g';
    *end += f->gray;
    return true;
}

static bool take_position(const char *const text, const char **const end, struct absolute_encoder *const e)
{
    return take_field(text, end, &e->position);
}

static bool take_turns(const char *const text, const char **const end, struct absolute_encoder *const e)
{
    return take_field(text, end, &e->turns);
}

static bool take_start(const char *const text, const char **const end, struct absolute_encoder *const e)
{
    long start;
    if (!read_signed(text, LONG_MAX, end, &start))
        return false;
    e->start = start;
    return true;
}

static bool take_speed(const char *const text, const char **const end, struct absolute_encoder *const e)
{
    return read_real(text, -MAX_SPEED, MAX_SPEED, end, &e->speed);
}

/* stepgen.N[:NUM/DEN] */
static bool take_axis(const char *const text, const char **const end, struct absolute_encoder *const e)
{
    return read_axis(text, end, &e->axis_gtag, &e->axis) &&
           (**end != ':' || read_ratio(*end + 1, end, &e->num, &e->den));
}

static bool take_ps(const char *const text, const char **const end, int64_t *const ps)
{
    unsigned long ns;
    if (!read_unsigned(text, MAX_NS, end, &ns))
        return false;
    *ps = (int64_t)ns * PS_PER_NS;
    return true;
}

static bool take_delay(const char *const text, const char **const end, struct absolute_encoder *const e)
{
    return take_ps(text, end, &e->data.delay_ps);
}

static bool take_idle(const char *const text, const char **const end, struct absolute_encoder *const e)
{
    return take_ps(text, end, &e->data.idle_ps);
}

static bool take_processing(const char *const text, const char **const end, struct absolute_encoder *const e)
{
    unsigned long clocks;
    if (!read_unsigned(text, MAX_CLOCKS, end, &clocks))
        return false;
    e->data.processing = (unsigned)clocks;
    return true;
}

static const struct {
    const char *key;
    bool (*take)(const char *text, const char **end, struct absolute_encoder *encoder);
} keys[] = {
    {"bits=", take_bits},   {"value=", take_value},           {"position=", take_position}, {"turns=", take_turns},
    {"start=", take_start}, {"speed=", take_speed},           {"with=", take_axis},         {"delay=", take_delay},
    {"idle=", take_idle},   {"processing=", take_processing},
};

static bool take_key(const char *const text, const char **const end, struct absolute_encoder *const e)
{
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++) {
        const size_t len = strlen(keys[i].key);
        if (strncmp(text, keys[i].key, len) == 0)
            return keys[i].take(text + len, end, e);
    }
    return false;
}

/* "ssi.0:" */
static bool take_reader(const char *const text, const char **const end, struct absolute_encoder *const e)
{
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        const size_t len = strlen(kinds[i].name);
        unsigned long unit;
        if (strncmp(text, kinds[i].name, len) != 0 || !read_unsigned(text + len, UINT8_MAX, end, &unit))
            continue;
        e->gtag = kinds[i].gtag;
        e->unit = (unsigned)unit;
        return *(*end)++ == ':';
    }
    return false;
}

static bool fits(const struct absolute_field *const f, const struct absolute_encoder *const e)
{
    return f->at + f->width <= e->data.bits || f->width == 0;
}

static bool is_whole(const struct absolute_encoder *const e)
{
    const bool moves = e->axis_gtag || e->start || e->speed < 0 || e->speed > 0;
    return e->data.bits > 0 && fits(&e->position, e) && fits(&e->turns, e) &&
           e->position.width + e->turns.width <= MAX_FIELD && (e->position.width > 0 || (!moves && !e->turns.width));
}

int absolute_option(const char *const text, struct absolute_encoder *const encoder, struct hm2_diag *const diag)
{
    struct absolute_encoder e = {.num = 1, .den = 1, .data.delay_ps = DELAY_PS};
    const char *at;
    bool good = take_reader(text, &at, &e);
    const bool none = good && strcmp(at, "none") == 0;
    while (good && !none) {
        good = take_key(at, &at, &e) && (*at == '\0' || *at == ',');
        if (!good || *at++ == '\0')
            break;
    }
    if (!good || (!none && !is_whole(&e)))
        return hm2_diag_add(
            diag, HM2_ERR_INVALID,
            "absolute encoder \"%s\": expected ssi.N, biss.N or fanuc.N, a colon and none, or bits=1..128 "
            "and of these, by commas: value=HEX, position=AT:WIDTH[g], turns=AT:WIDTH[g] (within the "
            "bits, 64 together), and with a position start=N, speed=N, with=stepgen.N[:NUM/DEN] or "
            "encoder.N; delay=NS, idle=NS, processing=CLOCKS",
            text);
    *encoder = e;
    return 0;
}

/* ---- at the card ------------------------------------------------------------------------------------------------- */

static void put_field(uint32_t value[const WORDS], const struct absolute_field *const f, const int64_t number)
{
    const uint64_t plain = (uint64_t)number;
    const uint64_t bits = f->gray ? plain ^ plain >> 1 : plain;
    for (unsigned i = 0; i < f->width; i++) {
        const unsigned at = f->at + i;
        const uint32_t mask = 1u << at % WORD_BITS;
        value[at / WORD_BITS] = (value[at / WORD_BITS] & ~mask) | ((bits >> i & 1u) ? mask : 0);
    }
}

/* Of a Gray field only as many bits are coded as it has. */
static int64_t low_bits(const int64_t number, const unsigned width)
{
    return width < MAX_FIELD ? (int64_t)((uint64_t)number & ((1ULL << width) - 1u)) : number;
}

static int64_t position_at(const struct absolutes *const a, const struct absolute_encoder *const e,
                           const int64_t now_ns)
{
    int64_t turned = 0;
    double moved = e->speed * ((double)now_ns / NS_PER_S);
    if (e->axis_gtag && sim_card_turned(a->card, e->axis_gtag, e->axis, &turned) == 0)
        moved += (double)turned * e->num / e->den;
    return (int64_t)((uint64_t)e->start + (uint64_t)(int64_t)floor(fmod(moved, WRAPS_AT)));
}

static int show(const struct absolutes *const a, const struct absolute_encoder *const e, const int64_t now_ns)
{
    struct sim_absolute data = e->data;
    const int64_t position = position_at(a, e, now_ns);
    put_field(data.value, &e->position, low_bits(position, e->position.width));
    if (e->turns.width > 0) /* with a position of fewer than 64 bits below it */
        put_field(data.value, &e->turns, low_bits(position >> e->position.width, e->turns.width));
    return sim_card_absolute(a->card, e->gtag, e->unit, &data);
}

static int attach(struct absolutes *const a, const struct absolute_encoder *const e, const int64_t now_ns,
                  struct hm2_diag *const diag)
{
    int64_t unused;
    if (e->axis_gtag && sim_card_turned(a->card, e->axis_gtag, e->axis, &unused))
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "--absolute: this card has no %s %u that turns",
                            e->axis_gtag == HM2_GTAG_STEPGEN ? "step generator" : "encoder", e->axis);
    if (show(a, e, now_ns))
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "--absolute: this card has no such reader (%s %u)",
                            e->gtag == HM2_GTAG_SSI    ? "ssi"
                            : e->gtag == HM2_GTAG_BISS ? "biss"
                                                       : "fanuc",
                            e->unit);
    return 0;
}

int absolutes_add(struct absolutes *const a, const struct absolute_encoder *const encoder, const int64_t now_ns,
                  struct hm2_diag *const diag)
{
    unsigned i = 0;
    while (i < a->count && (a->encoders[i].gtag != encoder->gtag || a->encoders[i].unit != encoder->unit))
        i++;
    if (i == MAX_ABSOLUTES)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "--absolute: at most %u encoders a card", MAX_ABSOLUTES);
    const int err = attach(a, encoder, now_ns, diag);
    if (err)
        return err;
    a->encoders[i] = *encoder;
    a->count += i == a->count;
    return 0;
}

int absolutes_connect(struct absolutes *const a, struct sim_card *const card,
                      const struct absolute_encoder *const encoders, const unsigned count, struct hm2_diag *const diag)
{
    int err = 0;
    *a = (struct absolutes){.card = card};
    for (unsigned i = 0; i < count && !err; i++)
        err = absolutes_add(a, &encoders[i], 0, diag);
    return err;
}

static bool moves(const struct absolute_encoder *const e)
{
    return e->axis_gtag || e->speed < 0 || e->speed > 0;
}

void absolutes_run(struct absolutes *const a, const int64_t now_ns)
{
    if (!absolutes_move(a))
        return;
    sim_card_advance(a->card, sim_card_clock_at(a->card, now_ns));
    for (unsigned i = 0; i < a->count; i++)
        if (moves(&a->encoders[i]))
            (void)!show(a, &a->encoders[i], now_ns); /* attach() has tried */
}

bool absolutes_move(const struct absolutes *const a)
{
    for (unsigned i = 0; i < a->count; i++)
        if (moves(&a->encoders[i]))
            return true;
    return false;
}
