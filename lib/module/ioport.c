/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * I/O ports (register map 3.1, hal-interface 2.3): levels of all pads, outputs of the pins that no module owns, and
 * the electrical set-up of every output.
 *
 * A pad is driven when its open drain bit is set and the data are 0, whatever the direction says (tests/data/ioport),
 * so polarity and source are written before open drain, and the direction last.
 *
 * Pins act in every cycle, as far as they can: the data of an input reach no pad, so `out` is read of pins only that
 * have been outputs, from the very write on that makes them so. Parameters cannot be linked to signals, only a person
 * sets them; one I/O is looked at in each cycle, and when it has changed, all of them.
 */
#include <stdio.h>

#include "bind.h"
#include "levels.h"
#include "module_types.h"

enum { REG_DATA, REG_DIRECTION, REG_ALT_SOURCE, REG_OPEN_DRAIN, REG_INVERT };

struct gpio_out {
    hm2_bit_t *out;
};

/* Parameters of an I/O that can be set up. */
struct io_setup {
    hm2_bit_t *invert_output, *open_drain;
    hm2_bit_t *is_output; /* of pins that no module owns; others have it on a constant 0 */
    uint8_t port, bit;
    uint8_t seen; /* the three, as they were looked at last */
};

/* One word per register and port, bit = I/O of the port. */
struct port {
    uint32_t present;                              /* bits of the width */
    uint32_t gpio;                                 /* not owned by a module */
    uint32_t driven;                               /* those of them that are outputs, or have been */
    uint32_t outputs;                              /* outputs of modules */
    uint32_t immediate;                            /* those of them that are driven from load on */
    uint32_t shown;                                /* levels as the pins have them */
    uint32_t is_output, invert_output, open_drain; /* what the parameters say */
    struct hm2_level *levels;
    struct gpio_out *out; /* of the bits in gpio */
};

struct ioport {
    struct port *ports;
    unsigned count;
    uint32_t turn; /* of which bits the levels are written next */
    struct io_setup *setups;
    unsigned setup_count;
    const struct io_setup *look; /* at which parameters we look next; NULL when there are none */
    hm2_bit_t nothing;           /* stays 0 */
    bool first_written;          /* deferred outputs have their direction */
    bool held_off;               /* the watchdog has cleared direction and open drain */
    struct hm2_window read, write;
    struct hm2_section invert, alt_source, open_drain, direction;
};

static const struct hm2_point level_points[] = {
    HM2_POINT(struct hm2_level, level, "###.in", HM2_BIT, HM2_PIN_OUT, 0, "", "level at the pad, also of outputs"),
    HM2_POINT(struct hm2_level, inverse, "###.in_not", HM2_BIT, HM2_PIN_OUT, 0, "", "inverse of in"),
};

static const struct hm2_point out_points[] = {
    HM2_POINT(struct gpio_out, out, "###.out", HM2_BIT, HM2_PIN_IN, 0, "", "value to drive"),
};

static const struct hm2_point direction_points[] = {
    HM2_POINT(struct io_setup, is_output, "###.is_output", HM2_BIT, HM2_PARAM_RW, 0, "", "1 = output, 0 = input"),
};

static const struct hm2_point output_points[] = {
    HM2_POINT(struct io_setup, invert_output, "###.invert_output", HM2_BIT, HM2_PARAM_RW, 0, "",
              "the card inverts what it drives"),
    HM2_POINT(struct io_setup, open_drain, "###.is_opendrain", HM2_BIT, HM2_PARAM_RW, 0, "",
              "drive low only; high = released"),
};

enum { GROUP_LEVEL, GROUP_OUT, GROUP_DIRECTION, GROUP_OUTPUT };

#define ROWS(table) table, sizeof(table) / sizeof(table)[0]

static const struct hm2_point_group groups[] = {
    [GROUP_LEVEL] = {"gpio", ROWS(level_points), NULL},
    [GROUP_OUT] = {"gpio", ROWS(out_points), "pins that no module uses"},
    [GROUP_DIRECTION] = {"gpio", ROWS(direction_points), "pins that no module uses"},
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
    const struct hm2_module_type *const type = pin->owner->type;
    const char *const stem = type->output_stem ? type->output_stem : type->name;
    char number[16] = "";
    if (all > 1)
        (void)snprintf(number, sizeof number, "%u.", before);
    for (size_t i = 0; i < sizeof output_points / sizeof output_points[0]; i++) {
        const char *const parameter = output_points[i].name + sizeof "###." - 1;
        char existing[HM2_NAME_SIZE], alias[HM2_NAME_SIZE];
        const int existing_len = snprintf(existing, sizeof existing, "%s.gpio.%03u.%s", setup->prefix, io, parameter);
        const int alias_len = snprintf(alias, sizeof alias, "%s.%s.%02u.%s%s.%s", setup->prefix, stem,
                                       pin->pd.secondary_unit, number, function, parameter);
        if (existing_len >= (int)sizeof existing || alias_len >= (int)sizeof alias ||
            setup->binder->alias(setup->binder, existing, alias) < 0)
            hm2_diag_warn(setup->diag, "%s gets no second name %s; use the first one", existing, alias);
    }
}

/* Parameters of an I/O, which has a direction to choose when no module owns it. */
static int bind_setup(const struct hm2_setup *const setup, struct ioport *const ctx, const unsigned io)
{
    struct io_setup *const row = &ctx->setups[ctx->setup_count++];
    ctx->look = ctx->setups;
    row->port = (uint8_t)(io / setup->idrom->port_width);
    row->bit = (uint8_t)(io % setup->idrom->port_width);
    int err = 0;
    if (setup->pins[io].owner)
        row->is_output = &ctx->nothing;
    else
        err = hm2_bind_group(setup, &groups[GROUP_DIRECTION], row, io);
    if (err == 0)
        err = hm2_bind_group(setup, &groups[GROUP_OUTPUT], row, io);
    if (err == 0)
        alias_output(setup, io);
    return err;
}

static int bind_io(const struct hm2_setup *const setup, struct ioport *const ctx, const unsigned io)
{
    const struct hm2_pin *const pin = &setup->pins[io];
    struct port *const port = &ctx->ports[io / setup->idrom->port_width];
    const unsigned bit = io % setup->idrom->port_width;
    const uint32_t mask = 1u << bit;
    int err = hm2_bind_group(setup, &groups[GROUP_LEVEL], &port->levels[bit], io);
    port->present |= mask;
    if (!pin->owner && err == 0) {
        port->gpio |= mask;
        err = hm2_bind_group(setup, &groups[GROUP_OUT], &port->out[bit], io);
    }
    if (pin->owner && is_output(pin)) {
        port->outputs |= mask;
        port->immediate |= pin->immediate ? mask : 0;
    }
    return err == 0 && (port->gpio | port->outputs) & mask ? bind_setup(setup, ctx, io) : err;
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

/* Memory, and what belongs to which port. */
static struct ioport *allocate(const struct hm2_setup *const setup)
{
    const struct hm2_idrom *const idrom = setup->idrom;
    struct ioport *const ctx = hm2_setup_alloc(setup, sizeof *ctx);
    struct port *const ports = hm2_setup_alloc(setup, idrom->io_ports * sizeof *ports);
    struct hm2_level *const levels = hm2_setup_alloc(setup, idrom->pin_count * sizeof *levels);
    struct gpio_out *const out = hm2_setup_alloc(setup, idrom->pin_count * sizeof *out);
    struct io_setup *const setups = hm2_setup_alloc(setup, idrom->pin_count * sizeof *setups);
    if (!ctx || !ports || !levels || !out || !setups)
        return NULL;
    ctx->ports = ports;
    ctx->count = idrom->io_ports;
    ctx->turn = HM2_FIRST_TURN;
    ctx->setups = setups;
    for (unsigned number = 0; number < ctx->count; number++) {
        ports[number].levels = &levels[number * idrom->port_width];
        ports[number].out = &out[number * idrom->port_width];
    }
    return ctx;
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    const struct hm2_idrom *const idrom = setup->idrom;
    if (module->md->instances < idrom->io_ports)
        return hm2_diag_add(setup->diag, HM2_ERR_MISMATCH,
                            "the IOPort module has %u instances, but the IDROM header says %u ports",
                            module->md->instances, (unsigned)idrom->io_ports);
    struct ioport *const ctx = allocate(setup);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    int err = add_registers(ctx, module->md, setup);
    for (unsigned io = 0; err == 0 && io < idrom->pin_count; io++)
        err = bind_io(setup, ctx, io);
    for (unsigned number = 0; err == 0 && number < ctx->count; number++) {
        hm2_section_set(&ctx->alt_source, number, ctx->ports[number].present & ~ctx->ports[number].gpio);
        apply(ctx, number);
    }
    return err;
}

/* ---- cycle ------------------------------------------------------------------------------------------------------ */

static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct ioport *const ctx = module->context;
    const uint8_t *word = ctx->read.bytes;
    const uint32_t turn = cycle->writes == 0 ? UINT32_MAX : ctx->turn;
    ctx->turn = hm2_next_turn(ctx->turn);
    for (struct port *port = ctx->ports, *const end = port + ctx->count; port < end; port++, word += 4) {
        const uint32_t levels = hm2_get_le32(word);
        const uint32_t shown = port->shown;
        port->shown = levels;
        hm2_show_levels(port->levels, levels, ((levels ^ shown) | turn) & port->present);
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

static uint8_t look(const struct io_setup *const row)
{
    return (uint8_t)(*row->invert_output | *row->open_drain << 1 | *row->is_output << 2);
}

/* Take all parameters over: at the first write, when one has changed, and when the watchdog bit or was told to forget
 * it. */
HM2_RARE static void take_parameters(struct ioport *const ctx)
{
    for (unsigned number = 0; number < ctx->count; number++) {
        struct port *const port = &ctx->ports[number];
        port->invert_output = port->open_drain = port->is_output = 0;
    }
    for (unsigned i = 0; i < ctx->setup_count; i++) {
        struct io_setup *const row = &ctx->setups[i];
        struct port *const port = &ctx->ports[row->port];
        row->seen = look(row);
        port->invert_output |= (row->seen & 1u) << row->bit;
        port->open_drain |= (row->seen >> 1 & 1u) << row->bit;
        port->is_output |= (row->seen >> 2 & 1u) << row->bit;
        port->driven |= port->is_output;
    }
    for (unsigned number = 0; number < ctx->count; number++)
        apply(ctx, number);
}

/* Has the I/O that is looked at next changed? */
static bool parameters_changed(struct ioport *const ctx)
{
    const struct io_setup *const row = ctx->look;
    ctx->look = row + 1 < ctx->setups + ctx->setup_count ? row + 1 : ctx->setups;
    return look(row) != row->seen;
}

static uint32_t outputs(const struct port *const port)
{
    uint32_t data = 0;
    for (uint32_t left = port->driven; left; left &= left - 1) {
        const unsigned bit = (unsigned)__builtin_ctz(left);
        data |= (uint32_t)*port->out[bit].out << bit;
    }
    return data;
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct ioport *const ctx = module->context;
    if (cycle->writes == 0 || cycle->bitten != ctx->held_off) {
        ctx->first_written = true;
        ctx->held_off = cycle->bitten;
        take_parameters(ctx);
    } else if (ctx->look && parameters_changed(ctx)) {
        take_parameters(ctx);
    }
    uint8_t *word = ctx->write.bytes;
    for (const struct port *port = ctx->ports, *const end = port + ctx->count; port < end; port++, word += 4)
        if (port->driven)
            hm2_put_le32(word, outputs(port));
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
