/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * InM and InMux (register map 3.17, hal-interface 2.13): inputs that the card scans and filters, and four 8-bit
 * counters for hand wheels on the input pairs (0,1), (2,3), (4,5) and (6,7).
 */
#include "scanned.h"

#include "bind.h"
#include "levels.h"

enum { REG_CONTROL, REG_FILTER_SELECT, REG_FILTERED, REG_RAW, REG_COUNTERS };

#define USED_REGISTERS  0x1Fu
#define MAX_INPUTS      32u
#define COUNTERS        4u
#define MAX_BIT_MASK    0x1Fu /* control, bits 4..0: number of inputs - 1 */
#define CONTROL_INVERT  0x20u /* the inputs arrive inverted on all boards (register map 3.17) */
#define DIVISOR_MAX     1023u /* control, bits 15..6 */
#define FAST_MAX        63u   /* control, bits 21..16 */
#define SLOW_MAX        1023u /* control, bits 31..22 */
#define CLOCKS_PER_STEP 4u    /* an input takes (divisor + 1) * 4 clocks */

struct counter {
    hm2_s32_t *count;
    hm2_bit_t *reset, *mode_4x;
};

struct instance {
    hm2_u32_t *scan_rate, *fast_scans, *slow_scans, *scan_width;
    uint32_t width;                        /* scan_width, as the card says */
    uint32_t for_rate, for_fast, for_slow; /* parameters that the control word was computed from */
    uint32_t present;                      /* inputs that exist as pins */
    unsigned end;                          /* behind the highest of them, in whole groups of HM2_GATHER */
    uint32_t shown, shown_raw, counts;     /* levels as the pins have them, and counters as they were read last */
    struct hm2_level filtered[MAX_INPUTS], raw[MAX_INPUTS];
    struct hm2_bit_in slow[MAX_INPUTS]; /* of inputs that do not exist: a constant 0 */
    struct counter counter[COUNTERS];
};

struct scanned {
    uint32_t turn; /* inputs whose levels are written next; in the first turn parameters are looked at too */
    uint32_t clock_hz, max_bits_per_s;
    hm2_bit_t nothing; /* stays 0 */
    struct instance *instance;
    /* one word per instance */
    struct hm2_window filtered, raw, counters, filter_select;
    struct hm2_section control, modes;
};

const struct hm2_point hm2_scanned_points[HM2_SCANNED_MODULE_ROWS] = {
    HM2_POINT(struct instance, scan_rate, "scan_rate", HM2_U32, HM2_PARAM_RW, 20000, "Hz",
              "scans of all inputs per second"),
    HM2_POINT(struct instance, fast_scans, "fast_scans", HM2_U32, HM2_PARAM_RW, 5, "scans",
              "filter length of fast inputs, 1 to 63"),
    HM2_POINT(struct instance, slow_scans, "slow_scans", HM2_U32, HM2_PARAM_RW, 500, "scans",
              "filter length of slow inputs, 1 to 1023"),
    HM2_POINT(struct instance, scan_width, "scan_width", HM2_U32, HM2_PARAM_RO, 0, "bits",
              "inputs that the card scans"),
};

const struct hm2_point hm2_scanned_filtered_points[HM2_SCANNED_LEVEL_ROWS] = {
    HM2_POINT(struct hm2_level, level, "input-##", HM2_BIT, HM2_PIN_OUT, 0, "", "filtered input"),
    HM2_POINT(struct hm2_level, inverse, "input-##-not", HM2_BIT, HM2_PIN_OUT, 0, "", "inverse of the filtered input"),
};

const struct hm2_point hm2_scanned_raw_points[HM2_SCANNED_LEVEL_ROWS] = {
    HM2_POINT(struct hm2_level, level, "raw-input-##", HM2_BIT, HM2_PIN_OUT, 0, "", "unfiltered input"),
    HM2_POINT(struct hm2_level, inverse, "raw-input-##-not", HM2_BIT, HM2_PIN_OUT, 0, "",
              "inverse of the unfiltered input"),
};

const struct hm2_point hm2_scanned_slow_points[HM2_SCANNED_SLOW_ROWS] = {
    HM2_POINT(struct hm2_bit_in, bit, "input-##-slow", HM2_BIT, HM2_PIN_IN, 0, "",
              "1 = filtered with slow_scans, 0 = with fast_scans"),
};

const struct hm2_point hm2_scanned_counter_points[HM2_SCANNED_COUNTER_ROWS] = {
    HM2_POINT(struct counter, mode_4x, "enc#_4xmode", HM2_BIT, HM2_PARAM_RW, 0, "",
              "1 = count every edge, 0 = once a cycle"),
    HM2_POINT(struct counter, count, "enc#-count", HM2_S32, HM2_PIN_OUT, 0, "counts", "hand wheel counter"),
    HM2_POINT(struct counter, reset, "enc#-reset", HM2_BIT, HM2_PIN_IN, 0, "", "1 = holds the count at 0"),
};

enum { GROUP_MODULE, GROUP_FILTERED, GROUP_RAW, GROUP_SLOW, GROUP_COUNTER };

/* ---- parameters ------------------------------------------------------------------------------------------------- */

/* Bring a parameter into its limits and show what is really used. */
static uint32_t limit(const struct hm2_module *const module, hm2_u32_t *const parameter, const char *const name,
                      const uint32_t lowest, const uint32_t highest, const unsigned unit)
{
    const uint32_t wanted = *parameter;
    const uint32_t used = wanted < lowest ? lowest : wanted > highest ? highest : wanted;
    if (used != wanted) {
        *parameter = used;
        hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, name, unit, wanted);
    }
    return used;
}

static uint32_t control_word(const struct hm2_module *const module, const unsigned unit)
{
    const struct scanned *const ctx = module->context;
    struct instance *const instance = &ctx->instance[unit];
    /* The lowest rate that the divisor can make, rounded down as LinuxCNC's driver does. */
    const uint32_t clocks_per_scan = CLOCKS_PER_STEP * instance->width; /* 4..128 */
    const uint32_t whole_hz = ctx->clock_hz / (clocks_per_scan * (DIVISOR_MAX + 1u));
    const uint32_t slowest = whole_hz > 0 ? whole_hz : 1u;
    instance->for_rate =
        limit(module, instance->scan_rate, "scan_rate", slowest, ctx->max_bits_per_s / instance->width, unit);
    instance->for_fast = limit(module, instance->fast_scans, "fast_scans", 1, FAST_MAX, unit);
    instance->for_slow = limit(module, instance->slow_scans, "slow_scans", 1, SLOW_MAX, unit);
    const uint64_t clocks = (uint64_t)clocks_per_scan * instance->for_rate; /* the rate is at least 1 */
    const uint32_t divisor = (uint32_t)(ctx->clock_hz / clocks);
    const uint32_t field = divisor == 0 ? 0 : divisor - 1u > DIVISOR_MAX ? DIVISOR_MAX : divisor - 1u;
    return CONTROL_INVERT | field << 6 | instance->for_fast << 16 | instance->for_slow << 22;
}

static uint32_t modes_word(const struct instance *const instance)
{
    uint32_t word = 0;
    for (unsigned i = 0; i < COUNTERS; i++)
        word |= (uint32_t)*instance->counter[i].mode_4x << 8 * i;
    return word;
}

/* ---- set-up ----------------------------------------------------------------------------------------------------- */

/* Inputs that pin descriptors name: codes 1 to 32 are inputs 0 to 31 (register map 4.2). */
static uint32_t described(const struct hm2_idrom *const idrom, const uint8_t gtag, const unsigned unit)
{
    uint32_t inputs = 0;
    for (unsigned io = 0; io < idrom->pin_count; io++) {
        const struct hm2_pd *const pd = &idrom->pins[io];
        if (pd->secondary_tag == gtag && (pd->secondary_unit == unit || pd->secondary_unit & HM2_UNIT_GLOBAL) &&
            pd->secondary_pin >= 1 && pd->secondary_pin <= MAX_INPUTS)
            inputs |= 1u << (pd->secondary_pin - 1u);
    }
    return inputs;
}

static int bind_inputs(const struct hm2_setup *const setup, const struct hm2_point_group *const groups,
                       struct instance *const instance, const unsigned unit)
{
    int err = 0;
    for (unsigned i = 0; err == 0 && i < MAX_INPUTS; i++) {
        if (!(instance->present >> i & 1u))
            continue;
        instance->end = (i / HM2_GATHER + 1u) * HM2_GATHER;
        err = hm2_bind_item(setup, &groups[GROUP_FILTERED], &instance->filtered[i], unit, i);
        if (err == 0)
            err = hm2_bind_item(setup, &groups[GROUP_RAW], &instance->raw[i], unit, i);
        if (err == 0)
            err = hm2_bind_item(setup, &groups[GROUP_SLOW], &instance->slow[i], unit, i);
    }
    for (unsigned i = 0; err == 0 && i < COUNTERS; i++)
        err = hm2_bind_item(setup, &groups[GROUP_COUNTER], &instance->counter[i], unit, i);
    return err;
}

static int setup_instance(const struct hm2_module *const module, struct hm2_setup *const setup, const unsigned unit,
                          const enum hm2_scanned_inputs inputs)
{
    struct scanned *const ctx = module->context;
    struct instance *const instance = &ctx->instance[unit];
    uint32_t control = 0;
    int err = setup->peek(setup, hm2_md_address(module->md, REG_CONTROL, unit), 1, &control);
    if (err < 0)
        return hm2_diag_add(setup->diag, err, "the control register of %s.%02u cannot be read: %s", module->type->name,
                            unit, hm2_strerror(err));
    instance->width = (control & MAX_BIT_MASK) + 1u;
    instance->present = UINT32_MAX >> (MAX_INPUTS - instance->width);
    if (inputs == HM2_SCANNED_BY_WIDTH_AND_PIN)
        instance->present |= described(setup->idrom, module->md->gtag, unit);
    err = hm2_bind_group(setup, &module->type->groups[GROUP_MODULE], instance, unit);
    if (err == 0) {
        *instance->scan_width = instance->width;
        err = bind_inputs(setup, module->type->groups, instance, unit);
    }
    for (unsigned i = 0; i < MAX_INPUTS; i++)
        if (!instance->slow[i].bit)
            instance->slow[i].bit = &ctx->nothing;
    return err;
}

static int add_registers(struct scanned *const ctx, const struct hm2_module *const module,
                         const struct hm2_setup *const setup)
{
    const struct hm2_md *const md = module->md;
    const struct {
        struct hm2_window *window;
        unsigned reg;
    } reads[] = {{&ctx->filtered, REG_FILTERED}, {&ctx->raw, REG_RAW}, {&ctx->counters, REG_COUNTERS}};
    int err = 0;
    for (size_t i = 0; err == 0 && i < sizeof reads / sizeof reads[0]; i++)
        err = hm2_plan_add_read(setup->plan, reads[i].window, HM2_RANK_NORMAL, hm2_md_address(md, reads[i].reg, 0),
                                module->instances, setup->diag);
    if (err == 0)
        err = hm2_plan_add_write(setup->plan, &ctx->filter_select, HM2_RANK_NORMAL,
                                 hm2_md_address(md, REG_FILTER_SELECT, 0), module->instances, setup->diag);
    if (err == 0)
        err = hm2_plan_add_setup(setup->plan, &ctx->control, HM2_RANK_NORMAL, hm2_md_address(md, REG_CONTROL, 0),
                                 module->instances, 0, setup->diag);
    if (err == 0)
        err = hm2_plan_add_setup(setup->plan, &ctx->modes, HM2_RANK_NORMAL, hm2_md_address(md, REG_COUNTERS, 0),
                                 module->instances, 0, setup->diag);
    return err;
}

int hm2_scanned_setup(struct hm2_module *const module, struct hm2_setup *const setup,
                      const enum hm2_scanned_inputs inputs, const uint32_t max_bits_per_s)
{
    const struct hm2_md *const md = module->md;
    if (module->instances == 0)
        return 0;
    /* Nothing else is checked in these descriptors (hal-interface 1.5), but one window per register needs this. */
    if (module->instances > 1 && (md->instance_stride != 4 || (md->multiple & USED_REGISTERS) != USED_REGISTERS))
        return hm2_diag_add(setup->diag, HM2_ERR_UNSUPPORTED,
                            "%s: several instances need stride 4 and multiple registers 0x1F, found stride %u and 0x%X",
                            module->type->name, (unsigned)md->instance_stride, (unsigned)md->multiple);
    struct scanned *const ctx = hm2_setup_alloc(setup, sizeof *ctx);
    struct instance *const instances = hm2_setup_alloc(setup, module->instances * sizeof *instances);
    if (!ctx || !instances)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    ctx->instance = instances;
    ctx->turn = HM2_FIRST_TURN;
    ctx->clock_hz = md->clock_hz;
    ctx->max_bits_per_s = max_bits_per_s;
    int err = hm2_claim_pins(module, setup, HM2_GTAG_NONE, module->instances, true, NULL);
    for (unsigned unit = 0; err == 0 && unit < module->instances; unit++)
        err = setup_instance(module, setup, unit, inputs);
    if (err == 0)
        err = add_registers(ctx, module, setup);
    /* From load on: without the inversion in the control word the first inputs that HAL sees would be upside down. */
    for (unsigned unit = 0; err == 0 && unit < module->instances; unit++)
        hm2_section_set(&ctx->control, unit, control_word(module, unit));
    return err;
}

/* ---- cycle ------------------------------------------------------------------------------------------------------ */

void hm2_scanned_start(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct scanned *const ctx = module->context;
    (void)cycle;
    for (unsigned unit = 0; unit < module->instances; unit++)
        ctx->instance[unit].counts = hm2_window_get(&ctx->counters, unit);
}

/* Four counters of eight bits each; reset holds a count at 0. */
HM2_RARE static void count(struct instance *const instance, const uint32_t counts)
{
    for (unsigned i = 0; i < COUNTERS; i++) {
        const struct counter *const counter = &instance->counter[i];
        const int8_t moved = (int8_t)(uint8_t)((counts >> 8 * i) - (instance->counts >> 8 * i));
        *counter->count = *counter->reset ? 0 : (int32_t)((uint32_t)*counter->count + (uint32_t)moved);
    }
    instance->counts = counts;
}

static bool is_reset(const struct instance *const instance)
{
    const struct counter *const counter = instance->counter;
    return ((unsigned)*counter[0].reset | (unsigned)*counter[1].reset | (unsigned)*counter[2].reset |
            (unsigned)*counter[3].reset) != 0;
}

void hm2_scanned_unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct scanned *const ctx = module->context;
    const uint32_t turn = cycle->writes == 0 ? UINT32_MAX : ctx->turn;
    ctx->turn = hm2_next_turn(ctx->turn);
    for (unsigned unit = 0; unit < module->instances; unit++) {
        struct instance *const instance = &ctx->instance[unit];
        const uint32_t filtered = hm2_window_get(&ctx->filtered, unit);
        const uint32_t raw = hm2_window_get(&ctx->raw, unit);
        const uint32_t counts = hm2_window_get(&ctx->counters, unit);
        const uint32_t filtered_changed = filtered ^ instance->shown, raw_changed = raw ^ instance->shown_raw;
        instance->shown = filtered;
        instance->shown_raw = raw;
        hm2_show_levels(instance->filtered, filtered, (filtered_changed | turn) & instance->present);
        hm2_show_levels(instance->raw, raw, (raw_changed | turn) & instance->present);
        /* Before the first write the filters are settling since load: what the counters do then is not a wheel. */
        if (cycle->writes == 0)
            instance->counts = counts;
        else if (counts != instance->counts || is_reset(instance))
            count(instance, counts);
    }
}

/* Parameters are only set by people: looked at in one turn of a round. */
HM2_RARE static void pack_parameters(const struct hm2_module *const module, const bool first)
{
    struct scanned *const ctx = module->context;
    for (unsigned unit = 0; unit < module->instances; unit++) {
        const struct instance *const instance = &ctx->instance[unit];
        hm2_section_set(&ctx->modes, unit, modes_word(instance));
        if (first || *instance->scan_rate != instance->for_rate || *instance->fast_scans != instance->for_fast ||
            *instance->slow_scans != instance->for_slow)
            hm2_section_set(&ctx->control, unit, control_word(module, unit));
    }
}

void hm2_scanned_pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct scanned *const ctx = module->context;
    for (unsigned unit = 0; unit < module->instances; unit++) {
        const struct instance *const instance = &ctx->instance[unit];
        hm2_window_set(&ctx->filter_select, unit, hm2_gather(instance->slow, instance->end));
    }
    if (ctx->turn == HM2_FIRST_TURN || cycle->writes == 0)
        pack_parameters(module, cycle->writes == 0);
}
