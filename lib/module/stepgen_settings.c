/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The rarely written registers of the step generators: pulse times, mode, output table, sampling timer, latches.
 */
#include "stepgen.h"

enum {
    REG_MODE = 2,
    REG_DIRSETUP = 3, /* and the other times behind it */
    REG_TABLE = 7,
    REG_TABLE_MAX = 8,
    REG_MASTER_DDS = 9,
    REG_TIMER = 10,
};

#define TIME_MAX        0x3FFFu /* 14 bits (register map 3.4) */
#define STEPLEN_MIN     1u      /* 0 never ends the pulse (register map 3.4) */
#define MASTER_DDS_FULL 0xFFFFFFFFu
#define NS_PER_S        1000000000u

/* Mode register (register map 3.4). */
#define MODE_TABLE        0x03u
#define MODE_SWAP         0x04u
#define MODE_LATCH_INDEX  0x10u
#define MODE_INDEX_RISING 0x20u
#define MODE_LATCH_PROBE  0x40u
#define MODE_PROBE_RISING 0x80u
#define MODE_LATCHES      (MODE_LATCH_INDEX | MODE_LATCH_PROBE)
#define LATCH_POSITION    0xFFFFFF00u /* read: accumulator at the latch without its low 8 bits */

uint32_t stepgen_clocks(const uint32_t time_ns, const uint32_t clock_hz)
{
    const uint64_t clocks = (uint64_t)time_ns * clock_hz / NS_PER_S;
    return clocks > TIME_MAX ? TIME_MAX : (uint32_t)clocks;
}

uint32_t stepgen_longest_ns(const uint32_t clock_hz)
{
    return clock_hz ? (uint32_t)((uint64_t)TIME_MAX * NS_PER_S / clock_hz) : 0;
}

static int add_generator(struct stepgen *const gen, const struct hm2_md *const md, const unsigned number,
                         struct hm2_setup *const setup)
{
    /* The table before its length, which also sets the table pointer to 0, and both before the mode that uses them. */
    int err = hm2_plan_add_setup(setup->plan, &gen->table, HM2_RANK_NORMAL, hm2_md_address(md, REG_TABLE, number),
                                 STEPGEN_TABLE_ENTRIES, HM2_SECTION_FIFO | HM2_SECTION_ON_DEMAND, setup->diag);
    if (!err)
        err = hm2_plan_add_setup(setup->plan, &gen->table_max, HM2_RANK_NORMAL,
                                 hm2_md_address(md, REG_TABLE_MAX, number), 1, HM2_SECTION_ON_DEMAND, setup->diag);
    if (!err)
        err = hm2_plan_add_setup(setup->plan, &gen->mode, HM2_RANK_NORMAL, hm2_md_address(md, REG_MODE, number), 1, 0,
                                 setup->diag);
    return err;
}

int stepgen_add_settings(struct hm2_module *const module, struct hm2_setup *const setup)
{
    struct stepgen_module *const ctx = module->context;
    const struct hm2_md *const md = module->md;
    int err = 0;
    for (unsigned t = 0; !err && t < STEPGEN_TIMES; t++) {
        err = hm2_plan_add_setup(setup->plan, &ctx->times[t], HM2_RANK_NORMAL, hm2_md_address(md, REG_DIRSETUP + t, 0),
                                 module->instances, 0, setup->diag);
        for (unsigned i = 0; !err && i < module->instances; i++)
            hm2_section_set(&ctx->times[t], i, TIME_MAX);
    }
    for (unsigned i = 0; !err && i < module->instances; i++)
        err = add_generator(&ctx->generator[i], md, i, setup);
    if (!err && ctx->timer.number && hm2_timer_page_free(setup->idrom, md, REG_TIMER))
        err = hm2_timer_add(&ctx->timer, module, setup, REG_TIMER);
    /* Last: the generators stand still until it is written (register map 6.4). */
    if (!err)
        err = hm2_plan_add_setup(setup->plan, &ctx->master_dds, HM2_RANK_LATE, hm2_md_address(md, REG_MASTER_DDS, 0), 1,
                                 0, setup->diag);
    if (!err)
        hm2_section_set(&ctx->master_dds, 0, MASTER_DDS_FULL);
    return err;
}

static void take_times(struct stepgen *const gen, struct stepgen_module *const ctx)
{
    static const char *const names[STEPGEN_TIMES] = {[STEPGEN_STEPLEN] = "steplen",
                                                     [STEPGEN_STEPSPACE] = "stepspace",
                                                     [STEPGEN_DIRSETUP] = "dirsetup",
                                                     [STEPGEN_DIRHOLD] = "dirhold"};
    const struct hm2_module *const module = gen->module;
    const uint32_t longest_ns = stepgen_longest_ns(module->md->clock_hz);
    for (unsigned t = 0; t < STEPGEN_TIMES; t++) {
        uint32_t time_ns = *gen->time_ns[t];
        uint32_t clocks = stepgen_clocks(time_ns, module->md->clock_hz);
        if (clocks == TIME_MAX && time_ns > longest_ns) {
            hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, names[t], gen->number, time_ns);
            *gen->time_ns[t] = time_ns = longest_ns;
        }
        if (t == STEPGEN_STEPLEN && clocks < STEPLEN_MIN)
            clocks = STEPLEN_MIN;
        gen->time_seen[t] = time_ns;
        hm2_section_set(&ctx->times[t], gen->number, clocks);
    }
}

static bool table_changed(const struct stepgen *const gen)
{
    uint32_t changed = 0;
    for (unsigned w = 0; w < STEPGEN_TABLE_WORDS; w++)
        changed |= *gen->table_data[w] ^ gen->table_seen[w];
    return changed != 0 || !gen->table_loaded;
}

/* The table is a shift register: what is written last becomes entry 0 (register map 3.4). */
static void load_table(struct stepgen *const gen, const uint32_t entries)
{
    for (unsigned e = 0; e < STEPGEN_TABLE_ENTRIES; e++) {
        const uint32_t data = *gen->table_data[e / 4] >> (8 * (e % 4)) & 0xFFu;
        hm2_section_set(&gen->table, STEPGEN_TABLE_ENTRIES - 1 - e, data);
    }
    hm2_section_set(&gen->table_max, 0, entries - 1);
    hm2_section_touch(&gen->table);
    hm2_section_touch(&gen->table_max);
    for (unsigned w = 0; w < STEPGEN_TABLE_WORDS; w++)
        gen->table_seen[w] = *gen->table_data[w];
    gen->table_loaded = true;
}

/* Step type as bits 1:0 of the mode; 3 to 16 is a table of that many entries. */
static uint32_t type_bits(struct stepgen *const gen)
{
    uint32_t type = *gen->step_type;
    if (type > STEPGEN_TABLE_ENTRIES) {
        hm2_notice_point(gen->module, HM2_NOTICE_TABLE_TOO_LONG, "step_type", gen->number, type);
        *gen->step_type = type = 0;
    }
    if (type < MODE_TABLE) {
        gen->type_seen = type;
        return type;
    }
    if (type != gen->type_seen || table_changed(gen))
        load_table(gen, type);
    gen->type_seen = type;
    return MODE_TABLE;
}

/* A latch is armed only from a confirmed word without it, so that the card's "not armed" before the write arrived is
 * never taken for an event (hal-interface 6, row 9). */
static uint32_t latch_bits(struct stepgen *const gen)
{
    uint32_t bits = 0;
    if (*gen->index_enable)
        bits |= MODE_LATCH_INDEX;
    if (*gen->probe_enable)
        bits |= MODE_LATCH_PROBE;
    bits &= ~gen->spent;
    gen->spent = 0;
    if (bits & ~gen->mode_word && !hm2_section_confirmed(&gen->mode))
        bits &= gen->mode_word;
    if (*gen->index_invert)
        bits |= MODE_INDEX_RISING;
    if (*gen->probe_invert)
        bits |= MODE_PROBE_RISING;
    return bits;
}

void stepgen_take_settings(struct stepgen *const gen)
{
    struct stepgen_module *const ctx = gen->module->context;
    take_times(gen, ctx);
    stepgen_take_limits(gen);
    uint32_t word = type_bits(gen);
    if (ctx->has_swap && *gen->swap_step_dir)
        word |= MODE_SWAP;
    if (ctx->has_latch)
        word |= latch_bits(gen);
    const bool watched = ctx->has_swap || (word & MODE_TABLE) == MODE_TABLE;
    if (watched != gen->watched)
        ctx->watched += watched ? 1u : UINT_MAX;
    gen->watched = watched;
    if (word != gen->mode_word) {
        gen->mode_word = word;
        hm2_section_set(&gen->mode, 0, word);
    }
}

void stepgen_forget_tables(struct stepgen_module *const ctx, const unsigned instances)
{
    for (unsigned i = 0; i < instances; i++)
        ctx->generator[i].table_loaded = false;
}

void stepgen_unpack_latch(struct stepgen *const gen, const uint32_t latch)
{
    const uint32_t fired = gen->mode_word & ~latch & MODE_LATCHES;
    if (!fired || !hm2_section_confirmed(&gen->mode))
        return;
    gen->spent = fired;
    const int32_t since = hm2_delta32(gen->accumulator, latch & LATCH_POSITION);
    *gen->position_latch = (double)(gen->subcounts - since) * (1.0 / 65536.0) / gen->scale;
    if (fired & MODE_LATCH_PROBE)
        *gen->probe_enable = false;
    if (fired & MODE_LATCH_INDEX) {
        gen->subcounts = since;
        *gen->index_enable = false;
    }
}
