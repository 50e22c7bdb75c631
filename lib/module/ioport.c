/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * I/O ports (register map 3.1, hal-interface 2.3): levels of all pads, outputs of the pins that no module owns, and
 * the electrical set-up of every output.
 *
 * A pad is driven when its open drain bit is set and the data are 0, whatever the direction says (tests/data/ioport),
 * so polarity and source are written before open drain, and the direction last.
 *
 * Pins act in every cycle. Parameters cannot be linked to signals, only a person sets them; they are looked at in
 * turns (levels.h), a few in each cycle and all of them within two or three cycles per port, which keeps the cycle
 * short.
 */
#include <stdio.h>

#include "bind.h"
#include "levels.h"
#include "module_types.h"

enum { REG_DATA, REG_DIRECTION, REG_ALT_SOURCE, REG_OPEN_DRAIN, REG_INVERT };

/* Pins and parameters of one I/O; NULL where the I/O has none. */
struct io_points {
    hm2_bit_t *out, *is_output;            /* pins that no module owns; others have out on a constant 0 */
    hm2_bit_t *invert_output, *open_drain; /* these and outputs of modules */
};

/* One word per register and port, bit = I/O of the port. */
struct port {
    uint32_t present;              /* bits of the width */
    unsigned gpio_first, gpio_end; /* bits from the lowest to behind the highest of gpio; equal when there is none */
    uint32_t gpio;                 /* not owned by a module */
    uint32_t adjustable;           /* has invert_output and is_opendrain */
    uint32_t outputs;              /* outputs of modules */
    uint32_t immediate;            /* those of them that are driven from load on */
    uint32_t shown;                /* levels as the pins have them */
    /* what the parameters say */
    uint32_t is_output, invert_output, open_drain;
    struct hm2_level *levels;
    struct io_points *points;
};

struct ioport {
    struct port *ports;
    unsigned count;
    unsigned turn_port, turn, turns; /* whose levels and parameters are looked at next, and turns of a port */
    hm2_bit_t nothing;               /* stays 0 */
    bool first_written;              /* deferred outputs have their direction */
    bool held_off;                   /* the watchdog has cleared direction and open drain */
    struct hm2_window read, write;
    struct hm2_section invert, alt_source, open_drain, direction;
};

static const struct hm2_point level_points[] = {
    HM2_POINT(struct hm2_level, level, "###.in", HM2_BIT, HM2_PIN_OUT, 0, "", "level at the pad, also of outputs"),
    HM2_POINT(struct hm2_level, inverse, "###.in_not", HM2_BIT, HM2_PIN_OUT, 0, "", "inverse of in"),
};

static const struct hm2_point gpio_points[] = {
    HM2_POINT(struct io_points, out, "###.out", HM2_BIT, HM2_PIN_IN, 0, "", "value to drive"),
    HM2_POINT(struct io_points, is_output, "###.is_output", HM2_BIT, HM2_PARAM_RW, 0, "", "1 = output, 0 = input"),
};

static const struct hm2_point output_points[] = {
    HM2_POINT(struct io_points, invert_output, "###.invert_output", HM2_BIT, HM2_PARAM_RW, 0, "",
              "the card inverts what it drives"),
    HM2_POINT(struct io_points, open_drain, "###.is_opendrain", HM2_BIT, HM2_PARAM_RW, 0, "",
              "drive low only; high = released"),
};

enum { GROUP_LEVEL, GROUP_GPIO, GROUP_OUTPUT };

#define ROWS(table) table, sizeof(table) / sizeof(table)[0]

static const struct hm2_point_group groups[] = {
    [GROUP_LEVEL] = {"gpio", ROWS(level_points), NULL},
    [GROUP_GPIO] = {"gpio", ROWS(gpio_points), "pins that no module uses"},
    [GROUP_OUTPUT] = {"gpio", ROWS(output_points), "pins that no module uses and outputs of modules"},
    {NULL, NULL, 0, NULL},
};

static bool is_output(const struct hm2_pin *const pin)
{
    return pin->pd.secondary_pin & HM2_PIN_OUTPUT;
}

/* ---- set-up ----------------------------------------------------------------------------------------------------- */

static const char *output_name(const struct hm2_pin *const pin)
{
    if (!pin->owner || !is_output(pin) || !pin->owner->type->output_name)
        return NULL;
    return pin->owner->type->output_name(&pin->pd);
}

static bool same_function(const struct hm2_pd *const a, const struct hm2_pd *const b)
{
    return a->secondary_tag == b->secondary_tag && a->secondary_unit == b->secondary_unit &&
           a->secondary_pin == b->secondary_pin;
}

/* Second names of an output's parameters, from the module that owns it. A function that several pins carry gets a
 * running number in front of its name (hal-interface 2.3). */
static void alias_output(const struct hm2_setup *const setup, const unsigned io)
{
    const struct hm2_pin *const pin = &setup->pins[io];
    const char *const function = output_name(pin);
    if (!function)
        return;
    unsigned before = 0, all = 0;
    for (unsigned other = 0; other < setup->idrom->pin_count; other++)
        if (setup->pins[other].owner == pin->owner && same_function(&setup->pins[other].pd, &pin->pd)) {
            all++;
            before += other < io;
        }
    char number[16] = "";
    if (all > 1)
        (void)snprintf(number, sizeof number, "%u.", before);
    for (size_t i = 0; i < sizeof output_points / sizeof output_points[0]; i++) {
        const char *const parameter = output_points[i].name + sizeof "###." - 1;
        char existing[HM2_NAME_SIZE], alias[HM2_NAME_SIZE];
        const int existing_len = snprintf(existing, sizeof existing, "%s.gpio.%03u.%s", setup->prefix, io, parameter);
        const int alias_len = snprintf(alias, sizeof alias, "%s.%s.%02u.%s%s.%s", setup->prefix, pin->owner->type->name,
                                       pin->pd.secondary_unit, number, function, parameter);
        if (existing_len >= (int)sizeof existing || alias_len >= (int)sizeof alias ||
            setup->binder->alias(setup->binder, existing, alias) < 0)
            hm2_diag_warn(setup->diag, "%s gets no second name %s; use the first one", existing, alias);
    }
}

static int bind_io(const struct hm2_setup *const setup, struct port *const port, const unsigned bit, const unsigned io)
{
    const struct hm2_pin *const pin = &setup->pins[io];
    const uint32_t mask = 1u << bit;
    int err = hm2_bind_group(setup, &groups[GROUP_LEVEL], &port->levels[bit], io);
    port->present |= mask;
    if (pin->owner && is_output(pin)) {
        port->outputs |= mask;
        if (pin->immediate)
            port->immediate |= mask;
    }
    if (err == 0 && !pin->owner) {
        port->gpio |= mask;
        port->gpio_first = port->gpio == mask ? bit : port->gpio_first;
        port->gpio_end = bit + 1;
        err = hm2_bind_group(setup, &groups[GROUP_GPIO], &port->points[bit], io);
    }
    if (err == 0 && (port->gpio | port->outputs) & mask) {
        port->adjustable |= mask;
        err = hm2_bind_group(setup, &groups[GROUP_OUTPUT], &port->points[bit], io);
        if (err == 0)
            alias_output(setup, io);
    }
    return err;
}

static int add_registers(struct ioport *const ctx, const struct hm2_md *const md, const struct hm2_setup *const setup)
{
    const struct {
        struct hm2_section *section;
        unsigned reg;
    } sections[] = {
        {&ctx->invert, REG_INVERT},
        {&ctx->alt_source, REG_ALT_SOURCE},
        {&ctx->open_drain, REG_OPEN_DRAIN},
        {&ctx->direction, REG_DIRECTION},
    };
    const uint16_t data = hm2_md_address(md, REG_DATA, 0);
    int err = hm2_plan_add_read(setup->plan, &ctx->read, HM2_RANK_NORMAL, data, ctx->count, setup->diag);
    if (err == 0)
        err = hm2_plan_add_write(setup->plan, &ctx->write, HM2_RANK_NORMAL, data, ctx->count, setup->diag);
    for (size_t i = 0; err == 0 && i < sizeof sections / sizeof sections[0]; i++)
        err = hm2_plan_add_setup(setup->plan, sections[i].section, HM2_RANK_EARLY,
                                 hm2_md_address(md, sections[i].reg, 0), ctx->count, 0, setup->diag);
    return err;
}

/* Send what a port's words say. Open drain drives by itself, so an input must not have it (register map 3.1). */
static void apply(struct ioport *const ctx, const unsigned number)
{
    const struct port *const port = &ctx->ports[number];
    const uint32_t modules = ctx->first_written ? port->outputs : port->immediate;
    uint32_t direction = modules | (ctx->first_written ? port->is_output : 0);
    if (ctx->held_off)
        direction = 0;
    hm2_section_set(&ctx->invert, number, port->invert_output);
    hm2_section_set(&ctx->open_drain, number, port->open_drain & direction);
    hm2_section_set(&ctx->direction, number, direction);
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    const struct hm2_idrom *const idrom = setup->idrom;
    if (module->md->instances != idrom->io_ports)
        return hm2_diag_add(setup->diag, HM2_ERR_MISMATCH,
                            "the IOPort module has %u instances, but the IDROM header says %u ports",
                            module->md->instances, (unsigned)idrom->io_ports);
    struct ioport *const ctx = hm2_setup_alloc(setup, sizeof *ctx);
    struct port *const ports = hm2_setup_alloc(setup, idrom->io_ports * sizeof *ports);
    struct hm2_level *const levels = hm2_setup_alloc(setup, idrom->pin_count * sizeof *levels);
    struct io_points *const points = hm2_setup_alloc(setup, idrom->pin_count * sizeof *points);
    if (!ctx || !ports || !levels || !points)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    ctx->ports = ports;
    ctx->count = idrom->io_ports;
    ctx->turns = hm2_turns(idrom->port_width);
    for (unsigned io = 0; io < idrom->pin_count; io++)
        points[io].out = &ctx->nothing;
    int err = add_registers(ctx, module->md, setup);
    for (unsigned number = 0; err == 0 && number < ctx->count; number++) {
        const unsigned first = number * idrom->port_width;
        ports[number].levels = &levels[first];
        ports[number].points = &points[first];
        for (unsigned bit = 0; err == 0 && bit < idrom->port_width; bit++)
            err = bind_io(setup, &ports[number], bit, first + bit);
        if (err == 0) {
            hm2_section_set(&ctx->alt_source, number, ports[number].present & ~ports[number].gpio);
            apply(ctx, number);
        }
    }
    return err;
}

/* ---- cycle ------------------------------------------------------------------------------------------------------ */

static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct ioport *const ctx = module->context;
    (void)cycle;
    for (unsigned number = 0; number < ctx->count; number++) {
        struct port *const port = &ctx->ports[number];
        const uint32_t levels = hm2_window_get(&ctx->read, number);
        uint32_t which = levels ^ port->shown;
        if (number == ctx->turn_port)
            which |= HM2_TURN_MASK(ctx->turn);
        port->shown = levels;
        hm2_show_levels(port->levels, levels, which & port->present);
    }
}

/* The first reply: every pin. */
static void start(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct ioport *const ctx = module->context;
    (void)cycle;
    for (unsigned number = 0; number < ctx->count; number++) {
        struct port *const port = &ctx->ports[number];
        port->shown = hm2_window_get(&ctx->read, number);
        hm2_show_levels(port->levels, port->shown, port->present);
    }
}

static void read_parameters(struct port *const port, const uint32_t which)
{
    uint32_t invert = 0, open_drain = 0, output = 0;
    for (uint32_t left = port->adjustable & which; left; left &= left - 1) {
        const unsigned bit = (unsigned)__builtin_ctz(left);
        invert |= (uint32_t)*port->points[bit].invert_output << bit;
        open_drain |= (uint32_t)*port->points[bit].open_drain << bit;
    }
    for (uint32_t left = port->gpio & which; left; left &= left - 1) {
        const unsigned bit = (unsigned)__builtin_ctz(left);
        output |= (uint32_t)*port->points[bit].is_output << bit;
    }
    port->invert_output = (port->invert_output & ~which) | invert;
    port->open_drain = (port->open_drain & ~which) | open_drain;
    port->is_output = (port->is_output & ~which) | output;
}

/* Everything at once: at the first write, and when the watchdog bit or was told to forget it. */
static void read_all_parameters(struct ioport *const ctx)
{
    for (unsigned number = 0; number < ctx->count; number++) {
        read_parameters(&ctx->ports[number], UINT32_MAX);
        apply(ctx, number);
    }
}

static uint32_t outputs(const struct port *const port)
{
    uint32_t data = 0;
    for (unsigned bit = port->gpio_end; bit > port->gpio_first; bit--)
        data = data << 1 | *port->points[bit - 1].out;
    return data << port->gpio_first;
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct ioport *const ctx = module->context;
    for (unsigned number = 0; number < ctx->count; number++)
        hm2_window_set(&ctx->write, number, outputs(&ctx->ports[number]));
    if (cycle->writes == 0 || cycle->bitten != ctx->held_off) {
        ctx->first_written = true;
        ctx->held_off = cycle->bitten;
        read_all_parameters(ctx);
        return;
    }
    read_parameters(&ctx->ports[ctx->turn_port], HM2_TURN_MASK(ctx->turn));
    apply(ctx, ctx->turn_port);
    if (++ctx->turn >= ctx->turns) {
        ctx->turn = 0;
        ctx->turn_port = ctx->turn_port + 1 < ctx->count ? ctx->turn_port + 1 : 0;
    }
}

static const struct hm2_md_variant variants[] = {
    {.version = 0, .registers = 5, .instance_stride = 4, .multiple = 0x1F}};

const struct hm2_module_type hm2_ioport_type = {
    .name = "gpio",
    .gtag = HM2_GTAG_IOPORT,
    .variants = variants,
    .variant_count = 1,
    .config_count = -1,
    .setup = setup,
    .start = start,
    .unpack = unpack,
    .pack = pack,
    .groups = groups,
};
