/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Resolvers (tag C0), six to a module. Registers: register map 3.14, traces resolver; points: hal-interface 2.18.
 *
 * A status bit is 1 when the signal is bad; position and velocity then do not move. The excitation is changed by a
 * command word that reads 0 again when the processor has carried it out; both are in the lists of every cycle.
 */
#include <math.h>

#include <hm2/module.h>

#include "bind.h"
#include "module_types.h"

enum { REG_COMMAND, REG_DATA, REG_STATUS, REG_VELOCITY, REG_POSITION };

#define CHANNELS    6u
#define TURN        4294967296.0
#define RAW_SHIFT   8      /* rawcounts has 2^24 in a turn */
#define PERIOD_CLK  5000.0 /* of the excitation after power-up and at 10 kHz */
#define JOINT_WAIT  5000u  /* cycles that use-position-file waits for a joint position other than 0 */
#define EXCITATIONS 3u

static const struct {
    double above_khz, khz;
    uint32_t command;
    double period_clk;
} excitations[EXCITATIONS] = {
    {8.0, 10.0, 0x803, PERIOD_CLK},
    {4.0, 5.0, 0x802, 2 * PERIOD_CLK},
    {-INFINITY, 2.5, 0x801, 4 * PERIOD_CLK},
};

struct resolver {
    hm2_float_t *position, *angle, *velocity, *velocity_rpm, *joint_pos_fb;
    hm2_s32_t *count, *rawcounts;
    hm2_bit_t *reset, *index_enable, *error, *use_position_file;
    hm2_float_t *scale, *velocity_scale;
    hm2_u32_t *index_divisor;
    uint32_t last; /* reading before */
    int64_t turned, zero;
    unsigned waited;
};

struct resolvers {
    hm2_float_t *excitation_khz;
    double for_khz, period_clk;
    unsigned count;
    struct hm2_window status, velocities, positions;
    struct hm2_section command;
    struct resolver resolver[];
};

#define ROW(field, name, type, dir, init, unit, help) \
    HM2_POINT(struct resolver, field, name, type, dir, init, unit, help)

static const struct hm2_point global_points[] = {
    HM2_POINT(struct resolvers, excitation_khz, "excitation-khz", HM2_FLOAT, HM2_PARAM_RW, -1, "kHz",
              "10, 5 or 2.5; negative = as the card starts, 10"),
};

static const struct hm2_point points[] = {
    ROW(position, "position", HM2_FLOAT, HM2_PIN_OUT, 0, "units", "turns * scale since reset or index"),
    ROW(angle, "angle", HM2_FLOAT, HM2_PIN_OUT, 0, "turns", "within an electrical turn, 0 to 1"),
    ROW(velocity, "velocity", HM2_FLOAT, HM2_PIN_OUT, 0, "units/s", "electrical turns in a second * velocity-scale"),
    ROW(velocity_rpm, "velocity-rpm", HM2_FLOAT, HM2_PIN_OUT, 0, "units/min", "velocity * 60"),
    ROW(count, "count", HM2_S32, HM2_PIN_OUT, 0, "counts", "2^24 in a turn, since reset or index"),
    ROW(rawcounts, "rawcounts", HM2_S32, HM2_PIN_OUT, 0, "counts", "2^24 in a turn, not affected by these"),
    ROW(reset, "reset", HM2_BIT, HM2_PIN_IN, 0, "", "1: count and position are held at 0"),
    ROW(index_enable, "index-enable", HM2_BIT, HM2_PIN_IO, 0, "", "1: zero at the next whole turn, then go to 0"),
    ROW(error, "error", HM2_BIT, HM2_PIN_OUT, 0, "", "1: the signal is too weak; the position stands"),
    ROW(joint_pos_fb, "joint-pos-fb", HM2_FLOAT, HM2_PIN_IN, 0, "units", "of the joint, for use-position-file"),
    ROW(scale, "scale", HM2_FLOAT, HM2_PARAM_RW, 1, "units", "position of a turn"),
    ROW(velocity_scale, "velocity-scale", HM2_FLOAT, HM2_PARAM_RW, 1, "", "velocity at a turn in a second"),
    ROW(index_divisor, "index-divisor", HM2_U32, HM2_PARAM_RW, 1, "", "electrical turns from index to index"),
    ROW(use_position_file, "use-position-file", HM2_BIT, HM2_PARAM_RW, 0, "",
        "1: wait for joint-pos-fb, then count from there, in the nearest turn"),
};

static const struct hm2_point_group groups[] = {
    HM2_GROUP("resolver", global_points, NULL),
    HM2_GROUP("resolver.##", points, NULL),
    {.prefix = NULL},
};

static const char *output_name(const struct hm2_pd *const pd)
{
    static const char *const names[] = {"nc",    "refpdm-plus", "refpdm-minus", "amux0",
                                        "amux1", "amux2",       "spics",        "spiclk"};
    const unsigned number = pd->secondary_pin - (HM2_PIN_OUTPUT | 1u);
    return number < sizeof names / sizeof names[0] ? names[number] : NULL;
}

/* ---- cycle ---------------------------------------------------------------------------------------------------------
 */

static double usable(hm2_float_t *const parameter, const struct hm2_module *const module, const char *const name,
                     const unsigned number)
{
    const double value = *parameter;
    if (isfinite(value) && value != 0.0)
        return value;
    hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, name, number, value);
    return *parameter = 1.0;
}

static void start(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct resolvers *const ctx = module->context;
    (void)cycle;
    for (unsigned i = 0; ctx && i < ctx->count; i++) {
        struct resolver *const r = &ctx->resolver[i];
        const uint32_t now = hm2_window_get(&ctx->positions, i);
        if (r->turned == 0 && r->last == 0)
            r->turned = now;
        r->last = now;
    }
}

#define ONE_TURN ((int64_t)1 << 32)

/* Indices at or below a position. The first is where the turn after that of the start begins, as LinuxCNC's driver has
 * it. */
static int64_t indices_below(const int64_t position, const int64_t per_index)
{
    const int64_t from_first = position - ONE_TURN, down = from_first / per_index;
    return from_first % per_index < 0 ? down - 1 : down;
}

static void find_index(struct resolver *const r, const int64_t before)
{
    const uint32_t divisor = *r->index_divisor ? *r->index_divisor : 1;
    const int64_t per_index = divisor * ONE_TURN;
    const int64_t from = indices_below(before, per_index), to = indices_below(r->turned, per_index);
    if (from == to)
        return;
    r->zero = (from < to ? to : from) * per_index + ONE_TURN;
    *r->index_enable = false;
}

/* LinuxCNC's motion controller adds the position of its file to what is read here. So the position is 0 until the
 * joint's is known, and from then on how far the resolver is from there, in the turn that is nearest. Whether it is
 * known. */
static bool take_file(struct resolver *const r, const struct hm2_module *const module, const unsigned number,
                      const uint32_t now)
{
    const double joint = *r->joint_pos_fb, turns = joint / usable(r->scale, module, "scale", number);
    if (!isfinite(turns)) {
        hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, "joint-pos-fb", number, joint);
        return false;
    }
    if (joint == 0.0 && ++r->waited < JOINT_WAIT)
        return false;
    const double whole = ceil(turns - now / TURN - 0.5);
    r->turned = r->last = now;
    r->zero = (int64_t)((turns - whole) * TURN); /* some turns at most */
    r->waited = 0;
    *r->use_position_file = false;
    return true;
}

static void show(const struct resolvers *const ctx, const struct hm2_module *const module, const unsigned number)
{
    const struct resolver *const r = &ctx->resolver[number];
    const double scale = usable(r->scale, module, "scale", number);
    const double rate_hz = module->md->clock_hz / ctx->period_clk;
    const int64_t moved = (int64_t)((uint64_t)r->turned - (uint64_t)r->zero);
    *r->rawcounts = (int32_t)(uint32_t)((uint64_t)r->turned >> RAW_SHIFT);
    *r->count = (int32_t)(uint32_t)((uint64_t)moved >> RAW_SHIFT);
    *r->position = (double)moved / TURN * scale;
    *r->angle = (uint32_t)(uint64_t)r->turned / TURN;
    *r->velocity = (int32_t)hm2_window_get(&ctx->velocities, number) / TURN * rate_hz *
                   usable(r->velocity_scale, module, "velocity-scale", number);
    *r->velocity_rpm = *r->velocity * 60.0;
}

static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct resolvers *const ctx = module->context;
    (void)cycle;
    const uint32_t bad = hm2_window_get(&ctx->status, 0);
    for (unsigned i = 0; i < ctx->count; i++) {
        struct resolver *const r = &ctx->resolver[i];
        const uint32_t now = hm2_window_get(&ctx->positions, i);
        *r->error = bad >> i & 1u;
        if (*r->use_position_file && !take_file(r, module, i, now))
            continue;
        const int64_t before = r->turned;
        r->turned = (int64_t)((uint64_t)r->turned + (uint64_t)(int64_t)(int32_t)(now - r->last));
        r->last = now;
        if (*r->index_enable)
            find_index(r, before);
        if (*r->reset)
            r->zero = r->turned;
        show(ctx, module, i);
    }
}

HM2_RARE static void change_excitation(struct resolvers *const ctx, const struct hm2_module *const module)
{
    const double wanted_khz = *ctx->excitation_khz;
    ctx->for_khz = wanted_khz;
    if (isnan(wanted_khz)) {
        hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, "excitation-khz", HM2_NO_INSTANCE, wanted_khz);
        *ctx->excitation_khz = ctx->for_khz = -1.0;
    }
    if (!(wanted_khz >= 0.0))
        return;
    for (unsigned i = 0; i < EXCITATIONS; i++) {
        if (!(wanted_khz > excitations[i].above_khz))
            continue;
        *ctx->excitation_khz = ctx->for_khz = excitations[i].khz;
        ctx->period_clk = excitations[i].period_clk;
        hm2_section_set(&ctx->command, 0, excitations[i].command);
        hm2_section_touch(&ctx->command);
        return;
    }
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct resolvers *const ctx = module->context;
    if (cycle->writes == 0 || *ctx->excitation_khz != ctx->for_khz)
        change_excitation(ctx, module);
}

/* ---- set-up --------------------------------------------------------------------------------------------------------
 */

static int setup(struct hm2_module *const module, struct hm2_setup *const setup_)
{
    const int wanted = setup_->config->count[HM2_CFG_RESOLVERS];
    unsigned count = module->instances ? CHANNELS : 0; /* the channels of the first module are those with addresses */
    if (wanted >= 0 && (unsigned)wanted < count)
        count = (unsigned)wanted;
    if (count == 0)
        return 0;
    struct resolvers *const ctx = hm2_setup_alloc(setup_, sizeof *ctx + count * sizeof ctx->resolver[0]);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    ctx->count = count;
    ctx->for_khz = -1.0;
    ctx->period_clk = PERIOD_CLK;
    int err = hm2_claim_pins(module, setup_, HM2_GTAG_NONE, module->instances, true, NULL);
    if (!err)
        err = hm2_bind_group(setup_, &groups[0], ctx, 0);
    for (unsigned i = 0; !err && i < count; i++)
        err = hm2_bind_group(setup_, &groups[1], &ctx->resolver[i], i);
    const struct {
        struct hm2_window *window;
        unsigned reg, words;
    } reads[] = {
        {&ctx->status, REG_STATUS, 1}, {&ctx->velocities, REG_VELOCITY, count}, {&ctx->positions, REG_POSITION, count}};
    for (size_t i = 0; i < sizeof reads / sizeof reads[0] && !err; i++)
        err = hm2_plan_add_read(setup_->plan, reads[i].window, HM2_RANK_NORMAL,
                                hm2_md_address(module->md, reads[i].reg, 0), reads[i].words, setup_->diag);
    return err ? err
               : hm2_plan_add_setup(setup_->plan, &ctx->command, HM2_RANK_NORMAL,
                                    hm2_md_address(module->md, REG_COMMAND, 0), 1, HM2_SECTION_ON_DEMAND, setup_->diag);
}

static const struct hm2_md_variant variants[] = {{0, 5, 4, 0x1F}};

const struct hm2_module_type hm2_resolver_type = {
    .name = "resolver",
    .gtag = HM2_GTAG_RESOLVER,
    .variants = variants,
    .variant_count = 1,
    .config_count = -1, /* counted in single resolvers, by setup() */
    .setup = setup,
    .start = start,
    .unpack = unpack,
    .pack = pack,
    .output_name = output_name,
    .groups = groups,
};
