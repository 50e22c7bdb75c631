/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* XY2Mod (tag 2B): galvanometer interfaces, XY2-100. Registers: register map 3.20; points: hal-interface 2.16. */
#include <math.h>

#include <hm2/module.h>

#include "bind.h"
#include "module_types.h"
#include "timer.h"

enum { REG_ACC = 0, REG_VEL = 2, REG_POS = 4, REG_MODE = 6, REG_COMMAND, REG_STATUS, REG_READ_TIMER, REG_WRITE_TIMER };

#define AXES          2u
#define FULL_SCALE    2147483647.0
#define POSITION_MAX  2147418112 /* the module's own limit */
#define VELOCITY_MAX  1073741823
#define VELOCITY_STEP 256.0  /* clocks between additions of the velocity */
#define ACCEL_STEP    4096.0 /* and of the acceleration */
#define CONTROL_MASK  0x7u
#define COMMAND_MASK  0xFFFFu
#define STATUS_MASK   0xFFFFFu
#define OVERFLOW_POS  0x040u /* Y is one bit higher */
#define OVERFLOW_VEL  0x100u
#define MODE_18_BIT   0x400u
#define MODE_COMMAND  0x1000u
#define MODE_DISABLED 0x3C9u /* clears the overflow flags */

#define SMALLEST_SCALE 1e-6 /* as for step generators */

enum kind { POSITION, VELOCITY, ACCELERATION, KINDS };

struct axis {
    hm2_float_t *command[KINDS], *scale, *position_fb, *velocity_fb;
    hm2_bit_t *mode_18_bit, *command_mode, *position_overflow, *velocity_overflow;
    hm2_u32_t *control, *command_word;
    double seen[KINDS];
    /* One each: what is sent for one interface must not order another to where it once was. */
    struct hm2_section values[KINDS];
};

struct galvo {
    struct axis axis[AXES];
    hm2_bit_t *enable;
    hm2_u32_t *status;
    bool enabled;
};

struct xy2mod {
    struct hm2_timer read_timer, write_timer;
    double velocity_units, acceleration_units; /* register units for 1 unit/s, 1 unit/s^2 at scale 1 */
    struct hm2_window velocities[AXES], positions[AXES], modes, statuses, modes_out, commands_out;
    struct galvo galvo[];
};

#define ROW(field, name, type, dir, init, unit, help) HM2_POINT(struct galvo, field, name, type, dir, init, unit, help)
#define AXIS(letter, a)                                                                                           \
    ROW(axis[a].command[POSITION], "pos" letter "-cmd", HM2_FLOAT, HM2_PIN_IN, 0, "units", "commanded position"), \
        ROW(axis[a].command[VELOCITY], "vel" letter "-cmd", HM2_FLOAT, HM2_PIN_IN, 0, "units/s",                  \
            "commanded velocity"),                                                                                \
        ROW(axis[a].command[ACCELERATION], "acc" letter "-cmd", HM2_FLOAT, HM2_PIN_IN, 0, "units/s^2",            \
            "commanded acceleration"),                                                                            \
        ROW(axis[a].scale, "pos" letter "-scale", HM2_FLOAT, HM2_PIN_IN, 1, "units", "position at full scale"),   \
        ROW(axis[a].position_fb, "pos" letter "-fb", HM2_FLOAT, HM2_PIN_OUT, 0, "units", "position as sent"),     \
        ROW(axis[a].velocity_fb, "vel" letter "-fb", HM2_FLOAT, HM2_PIN_OUT, 0, "units/s", "velocity as sent"),   \
        ROW(axis[a].mode_18_bit, "18bitmode" letter, HM2_BIT, HM2_PIN_IN, 0, "", "1: 18 bits a frame, 0: 16"),    \
        ROW(axis[a].command_mode, "commandmode" letter, HM2_BIT, HM2_PIN_IN, 0, "",                               \
            "1: send the command word instead of the position"),                                                  \
        ROW(axis[a].control, "control" letter, HM2_U32, HM2_PIN_IN, 1, "", "three control bits of a frame"),      \
        ROW(axis[a].command_word, "command" letter, HM2_U32, HM2_PIN_IN, 0, "", "command word, 16 bits"),         \
        ROW(axis[a].position_overflow, "pos" letter "-overflow", HM2_BIT, HM2_PIN_OUT, 0, "",                     \
            "1: the position has reached its limit"),                                                             \
        ROW(axis[a].velocity_overflow, "vel" letter "-overflow", HM2_BIT, HM2_PIN_OUT, 0, "",                     \
            "1: the velocity has reached its limit")

static const struct hm2_point timer_points[] = {
    HM2_POINT(struct xy2mod, read_timer.number, "read-timer-number", HM2_S32, HM2_PIN_IN, -1, "",
              "DPLL timer that samples what is read, 0 to 4; -1 = none"),
    HM2_POINT(struct xy2mod, write_timer.number, "write-timer-number", HM2_S32, HM2_PIN_IN, -1, "",
              "DPLL timer that applies what was written, 0 to 4; -1 = none"),
};

static const struct hm2_point points[] = {
    AXIS("x", 0),
    AXIS("y", 1),
    ROW(enable, "enable", HM2_BIT, HM2_PIN_IN, 0, "", "0: everything is zero, and overflows are cleared"),
    ROW(status, "status", HM2_U32, HM2_PIN_OUT, 0, "", "20 bits that the scanner sent back"),
};

enum { GROUP_TIMERS, GROUP_ALWAYS };

static const struct hm2_point_group groups[] = {
    [GROUP_TIMERS] = HM2_GROUP("xy2mod", timer_points, "when the firmware has a DPLL"),
    [GROUP_ALWAYS] = HM2_GROUP("xy2mod.##", points, NULL),
    {.prefix = NULL},
};

static const char *output_name(const struct hm2_pd *const pd)
{
    static const char *const names[] = {"datax", "datay", "clk", "sync"};
    const unsigned number = pd->secondary_pin - (HM2_PIN_OUTPUT | 1u);
    return number < sizeof names / sizeof names[0] ? names[number] : NULL;
}

static const char *const command_names[KINDS][AXES] = {
    [POSITION] = {"posx-cmd", "posy-cmd"},
    [VELOCITY] = {"velx-cmd", "vely-cmd"},
    [ACCELERATION] = {"accx-cmd", "accy-cmd"},
};

/* ---- arithmetic ----------------------------------------------------------------------------------------------------
 */

/* Of axis a of an interface. */
static double scale_of(const struct axis *const axis, const struct hm2_module *const module, const unsigned number,
                       const unsigned a)
{
    static const char *const names[AXES] = {"posx-scale", "posy-scale"};
    const double scale = *axis->scale;
    if (isfinite(scale) && fabs(scale) >= SMALLEST_SCALE)
        return scale;
    hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, names[a], number, scale);
    return *axis->scale = scale < 0.0 ? -1.0 : 1.0;
}

/* How a command becomes register units at scale 1, and what the register takes. */
static double units_of(const struct xy2mod *const ctx, const enum kind kind, const double command, const double scale)
{
    if (kind == POSITION)
        return command * FULL_SCALE / scale;
    return command * scale * (kind == VELOCITY ? ctx->velocity_units : ctx->acceleration_units);
}

static uint32_t value_of(const struct hm2_module *const module, const unsigned number, const unsigned a,
                         const enum kind kind, const double scale)
{
    static const int32_t limits[KINDS] = {
        [POSITION] = POSITION_MAX, [VELOCITY] = VELOCITY_MAX, [ACCELERATION] = INT32_MAX};
    const struct xy2mod *const ctx = module->context;
    const double command = *ctx->galvo[number].axis[a].command[kind];
    const int32_t all = hm2_trunc_s32(units_of(ctx, kind, command, scale)), limit = limits[kind];
    if (all <= limit && all >= -limit)
        return (uint32_t)all;
    hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, command_names[kind][a], number, command);
    return (uint32_t)(all < 0 ? -limit : limit);
}

/* ---- cycle ---------------------------------------------------------------------------------------------------------
 */

static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct xy2mod *const ctx = module->context;
    (void)cycle;
    for (unsigned i = 0; i < module->instances; i++) {
        const struct galvo *const g = &ctx->galvo[i];
        const uint32_t mode = hm2_window_get(&ctx->modes, i);
        for (unsigned a = 0; a < AXES; a++) {
            const double scale = scale_of(&g->axis[a], module, i, a);
            *g->axis[a].position_fb = (int32_t)hm2_window_get(&ctx->positions[a], i) / FULL_SCALE / scale;
            *g->axis[a].velocity_fb = (int32_t)hm2_window_get(&ctx->velocities[a], i) / ctx->velocity_units / scale;
            *g->axis[a].position_overflow = mode & OVERFLOW_POS << a;
            *g->axis[a].velocity_overflow = mode & OVERFLOW_VEL << a;
        }
        *g->status = hm2_window_get(&ctx->statuses, i) & STATUS_MASK;
    }
}

/* A new scale acts on what is commanded from then on: the module has moved on, and must not jump back. */
static void send_commands(struct axis *const axis, const struct hm2_module *const module, const unsigned number,
                          const unsigned a)
{
    const double scale = scale_of(axis, module, number, a);
    for (unsigned kind = 0; kind < KINDS; kind++) {
        const double command = *axis->command[kind];
        if (!isfinite(command)) {
            hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, command_names[kind][a], number, command);
            continue; /* as before */
        }
        if (command == axis->seen[kind])
            continue;
        axis->seen[kind] = command;
        hm2_section_set(&axis->values[kind], 0, value_of(module, number, a, (enum kind)kind, scale));
        hm2_section_touch(&axis->values[kind]); /* the same position again is another order, as the module has moved */
    }
}

static void rest(struct axis *const axis, const bool was_enabled)
{
    for (unsigned kind = 0; kind < KINDS; kind++) {
        *axis->command[kind] = 0.0;
        hm2_section_set(&axis->values[kind], 0, 0);
        if (was_enabled) /* the module has moved on since a 0 was sent */
            hm2_section_touch(&axis->values[kind]);
    }
}

static uint32_t axis_mode(const struct axis *const axis, const unsigned a)
{
    return (*axis->control & CONTROL_MASK) << 3 * a | (*axis->mode_18_bit ? MODE_18_BIT << a : 0) |
           (*axis->command_mode ? MODE_COMMAND << a : 0);
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct xy2mod *const ctx = module->context;
    (void)cycle;
    for (unsigned i = 0; i < module->instances; i++) {
        struct galvo *const g = &ctx->galvo[i];
        const bool enabled = *g->enable, begins = enabled && !g->enabled;
        uint32_t mode = enabled ? 0 : MODE_DISABLED, command = 0;
        for (unsigned a = 0; a < AXES; a++) {
            struct axis *const axis = &g->axis[a];
            if (begins)
                axis->seen[POSITION] = axis->seen[VELOCITY] = axis->seen[ACCELERATION] = NAN;
            if (!enabled) {
                rest(axis, g->enabled);
                continue;
            }
            send_commands(axis, module, i, a);
            mode |= axis_mode(axis, a);
            command |= (*axis->command_word & COMMAND_MASK) << 16 * a;
        }
        g->enabled = enabled;
        hm2_window_set(&ctx->modes_out, i, mode);
        hm2_window_set(&ctx->commands_out, i, command);
    }
    hm2_timer_pack(&ctx->read_timer, module);
    hm2_timer_pack(&ctx->write_timer, module);
}

/* ---- set-up --------------------------------------------------------------------------------------------------------
 */

static int add_reads(struct xy2mod *const ctx, const struct hm2_module *const module, struct hm2_setup *const setup)
{
    const struct {
        struct hm2_window *window;
        unsigned reg;
    } reads[] = {
        {&ctx->velocities[0], REG_VEL}, {&ctx->velocities[1], REG_VEL + 1},
        {&ctx->positions[0], REG_POS},  {&ctx->positions[1], REG_POS + 1},
        {&ctx->modes, REG_MODE},        {&ctx->statuses, REG_STATUS},
    };
    int err = 0;
    for (size_t i = 0; i < sizeof reads / sizeof reads[0] && !err; i++)
        err = hm2_plan_add_read(setup->plan, reads[i].window, HM2_RANK_NORMAL,
                                hm2_md_address(module->md, reads[i].reg, 0), module->instances, setup->diag);
    return err;
}

static int add_writes(struct xy2mod *const ctx, const struct hm2_module *const module, struct hm2_setup *const setup)
{
    static const unsigned first[KINDS] = {[POSITION] = REG_POS, [VELOCITY] = REG_VEL, [ACCELERATION] = REG_ACC};
    const struct hm2_md *const md = module->md;
    const unsigned n = module->instances;
    int err = hm2_plan_add_write(setup->plan, &ctx->modes_out, HM2_RANK_NORMAL, hm2_md_address(md, REG_MODE, 0), n,
                                 setup->diag);
    if (!err)
        err = hm2_plan_add_write(setup->plan, &ctx->commands_out, HM2_RANK_NORMAL, hm2_md_address(md, REG_COMMAND, 0),
                                 n, setup->diag);
    for (unsigned i = 0; i < n * KINDS * AXES && !err; i++) {
        const unsigned galvo = i / (KINDS * AXES), kind = i / AXES % KINDS, a = i % AXES;
        err = hm2_plan_add_setup(setup->plan, &ctx->galvo[galvo].axis[a].values[kind], HM2_RANK_NORMAL,
                                 hm2_md_address(md, first[kind] + a, galvo), 1, 0, setup->diag);
    }
    if (!err && ctx->read_timer.number)
        err = hm2_timer_add(&ctx->read_timer, module, setup, REG_READ_TIMER);
    if (!err && ctx->write_timer.number)
        err = hm2_timer_add(&ctx->write_timer, module, setup, REG_WRITE_TIMER);
    return err;
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup_)
{
    if (module->instances == 0)
        return 0;
    if (hm2_check_page(module, setup_, "galvo interfaces"))
        return HM2_ERR_MISMATCH;
    struct xy2mod *const ctx = hm2_setup_alloc(setup_, sizeof *ctx + module->instances * sizeof ctx->galvo[0]);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    const double clock_hz = module->md->clock_hz;
    ctx->velocity_units = VELOCITY_STEP * 2147483648.0 / clock_hz;
    ctx->acceleration_units = ACCEL_STEP * 4294967296.0 * 32768.0 / (clock_hz * clock_hz * VELOCITY_STEP);
    ctx->read_timer.name = "read-timer-number";
    ctx->write_timer.name = "write-timer-number";
    int err = hm2_claim_pins(module, setup_, HM2_GTAG_NONE, module->instances, false, NULL);
    if (!err && setup_->has_dpll)
        err = hm2_bind_group(setup_, &groups[GROUP_TIMERS], ctx, 0);
    for (unsigned i = 0; !err && i < module->instances; i++)
        err = hm2_bind_group(setup_, &groups[GROUP_ALWAYS], &ctx->galvo[i], i);
    if (!err)
        err = add_reads(ctx, module, setup_);
    return err ? err : add_writes(ctx, module, setup_);
}

static const struct hm2_md_variant variants[] = {{0, 11, 4, 0x1FF}};

const struct hm2_module_type hm2_xy2mod_type = {
    .name = "xy2mod",
    .gtag = HM2_GTAG_XY2MOD,
    .variants = variants,
    .variant_count = 1,
    .config_count = HM2_CFG_XY2MODS,
    .setup = setup,
    .unpack = unpack,
    .pack = pack,
    .output_name = output_name,
    .groups = groups,
};
