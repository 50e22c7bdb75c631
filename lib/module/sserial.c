/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Smart serial (tags C1 and C6): set-up of the ports (register map 3.8, hal-interface 4).
 *
 * Remotes can be asked only while their pins are driven, which no module has arranged yet: the ports' direction and
 * source are set here for the time of discovery, and cleared again. The pins of a channel without a remote stay GPIO.
 */
#include <stdio.h>

#include "bind.h"
#include "module_types.h"
#include "sserial.h"

enum { IOPORT_DIRECTION = 1, IOPORT_ALT_SOURCE = 2 };
#define MAX_IOPORTS 16u

/* ---- pins ---------------------------------------------------------------------------------------------------------
 */

/* Codes of the functions are channel + 1 in the lower half (register map 4.2). */
static unsigned channel_of(const struct hm2_pd *const pd)
{
    return (pd->secondary_pin & 0x0Fu) - 1u;
}

static bool is_ours(const struct hm2_module *const module, const struct hm2_pd *const pd)
{
    return pd->secondary_tag == module->md->gtag && channel_of(pd) < SSLBP_CHANNELS &&
           pd->secondary_unit < module->md->instances;
}

static unsigned channels_with_pins(const struct hm2_module *const module, const struct hm2_setup *const setup,
                                   const unsigned port)
{
    unsigned mask = 0;
    for (unsigned io = 0; io < setup->idrom->pin_count; io++) {
        const struct hm2_pd *const pd = &setup->pins[io].pd;
        if (is_ours(module, pd) && pd->secondary_unit == port)
            mask |= 1u << channel_of(pd);
    }
    return mask;
}

/* Channels that the configuration lets us use. */
static unsigned channels_to_use(const struct hm2_module *const module, const struct hm2_setup *const setup,
                                const unsigned port)
{
    unsigned mask = channels_with_pins(module, setup, port);
    if (port >= hm2_config_sserial_ports(setup->config, module->md->instances))
        return 0;
    for (unsigned channel = 0; port < HM2_CFG_SSERIAL_PORTS && channel < HM2_CFG_SSERIAL_CHANNELS; channel++) {
        const char mode = setup->config->sserial_mode[port][channel];
        const unsigned bit = 1u << channel;
        if (setup->config->sserial_port_given[port] && mode >= '1' && mode <= '9' && !(mask & bit))
            hm2_diag_warn(setup->diag,
                          "%s: config sserial_port_%u asks for mode %c of channel %u, which has no pins "
                          "in this firmware",
                          setup->prefix, port, mode, channel);
        if (mode == 'x')
            mask &= ~bit;
    }
    return mask;
}

static int write_ports(struct hm2_setup *const setup, const struct hm2_md *const ioport, const unsigned reg,
                       const uint32_t *const words)
{
    int err = 0;
    for (unsigned i = 0; err == 0 && i < ioport->instances && i < MAX_IOPORTS; i++)
        err = setup->poke(setup, hm2_md_address(ioport, reg, i), 1, &words[i]);
    return err;
}

/* Drive the outputs of these channels (one mask per port), or with masks of 0 none. */
static int drive(const struct hm2_module *const module, struct hm2_setup *const setup,
                 const unsigned masks[SSERIAL_PORTS])
{
    const struct hm2_md *const ioport = hm2_idrom_find(setup->idrom, HM2_GTAG_IOPORT);
    uint32_t words[MAX_IOPORTS] = {0};
    if (!ioport || setup->idrom->port_width == 0)
        return 0;
    for (unsigned io = 0; io < setup->idrom->pin_count; io++) {
        const struct hm2_pd *const pd = &setup->pins[io].pd;
        const unsigned port = io / setup->idrom->port_width;
        if (is_ours(module, pd) && (pd->secondary_pin & HM2_PIN_OUTPUT) && pd->secondary_unit < SSERIAL_PORTS &&
            (masks[pd->secondary_unit] >> channel_of(pd) & 1u) && port < MAX_IOPORTS)
            words[port] |= 1u << io % setup->idrom->port_width;
    }
    int err = write_ports(setup, ioport, IOPORT_ALT_SOURCE, words);
    if (err == 0)
        err = write_ports(setup, ioport, IOPORT_DIRECTION, words);
    return err < 0 ? hm2_diag_add(setup->diag, err, "%s: the pins of smart serial cannot be driven (%s)", setup->prefix,
                                  hm2_strerror(err))
                   : 0;
}

static int claim(const struct hm2_module *const module, const struct hm2_setup *const setup, const unsigned port,
                 const unsigned channels)
{
    int err = 0;
    for (unsigned io = 0; err == 0 && io < setup->idrom->pin_count; io++) {
        const struct hm2_pd *const pd = &setup->pins[io].pd;
        if (is_ours(module, pd) && pd->secondary_unit == port && (channels >> channel_of(pd) & 1u))
            err = hm2_claim_pin(module, setup, io, true);
    }
    return err;
}

/* ---- registers ----------------------------------------------------------------------------------------------------
 */

static int add_windows(struct hm2_plan *const plan, struct sserial_port *const port, const struct sslbp_port *const at,
                       struct hm2_diag *const diag)
{
    const uint16_t skip = (uint16_t)(4u * port->first);
    /* A command is looked at before what it brought and written after what it takes. */
    int err = hm2_plan_add_read(plan, &port->command, HM2_RANK_FIRST, at->command, 1, diag);
    if (err == 0)
        err = hm2_plan_add_read(plan, &port->data, HM2_RANK_FIRST, at->data, 1, diag);
    if (err == 0)
        err = hm2_plan_add_read(plan, &port->cs, HM2_RANK_NORMAL, (uint16_t)(at->cs + skip), port->channels, diag);
    if (err == 0)
        err = hm2_plan_add_write(plan, &port->cs_out, HM2_RANK_NORMAL, (uint16_t)(at->cs + skip), port->channels, diag);
    for (unsigned i = 0; err == 0 && i < port->user_words; i++)
        err = hm2_plan_add_read(plan, &port->user[i], HM2_RANK_NORMAL, (uint16_t)(at->user[i] + skip), port->channels,
                                diag);
    for (unsigned i = 0; err == 0 && i < port->write_words; i++)
        err = hm2_plan_add_write(plan, &port->user_out[i], HM2_RANK_NORMAL, (uint16_t)(at->user[i] + skip),
                                 port->channels, diag);
    return err < 0 ? err : hm2_plan_add_write(plan, &port->command_out, HM2_RANK_LATE, at->command, 1, diag);
}

/* A DOIT with 9 bytes there and 10 back takes 113 us at 2.5 Mbaud, of which 76 are ten bits for each of the bytes
 * (tests/data/sslbp). Channels work at the same time, served by one processor. */
#define DOIT_NS         INT64_C(60000)
#define DOIT_CHANNEL_NS INT64_C(10000)
#define DOIT_BITS       10
#define DOIT_BYTES      4u /* that are not process data */
#define DEFAULT_BAUD    2500000

static int64_t doit_ns(const struct sserial_port *const port, const int baud)
{
    unsigned most = 0;
    for (unsigned i = 0; i < port->remote_count; i++) {
        const unsigned bytes = DOIT_BYTES + 4u * (port->remotes[i].in_words + port->remotes[i].out_words);
        most = bytes > most ? bytes : most;
    }
    return DOIT_NS + DOIT_CHANNEL_NS * port->remote_count +
           most * DOIT_BITS * INT64_C(1000000000) / (baud > 0 ? baud : DEFAULT_BAUD);
}

/* Registers 0 to 2 are read in any case: after a START they tell whether it is still the same remote. A parameter may
 * need two to be written. */
static void measure(struct sserial_port *const port, const unsigned mask)
{
    port->first = (uint8_t)__builtin_ctz(mask);
    port->channels = (uint8_t)(32u - (unsigned)__builtin_clz(mask) - port->first);
    port->user_words = 3;
    port->write_words = 2;
    for (unsigned i = 0; i < port->remote_count; i++) {
        const struct sserial_remote *const remote = &port->remotes[i];
        port->user_words = remote->in_words > port->user_words ? remote->in_words : port->user_words;
        port->write_words = remote->out_words > port->write_words ? remote->out_words : port->write_words;
    }
}

/* ---- set-up -------------------------------------------------------------------------------------------------------
 */

static int bus_read(void *const access, const uint16_t address, const unsigned words, uint32_t *const values)
{
    struct hm2_setup *const setup = access;
    return setup->peek(setup, address, words, values);
}

static int bus_write(void *const access, const uint16_t address, const unsigned words, const uint32_t *const values)
{
    struct hm2_setup *const setup = access;
    return setup->poke(setup, address, words, values);
}

static int64_t bus_now_ns(void *const access)
{
    const struct hm2_setup *const setup = access;
    return setup->now_ns(setup);
}

static int bind_remotes(const struct hm2_setup *const setup, struct sserial_port *const port,
                        const struct sslbp_port *const access, const struct sserial_found *const found)
{
    port->remotes = hm2_setup_alloc(setup, (size_t)__builtin_popcount(found->mask) * sizeof *port->remotes);
    if (!port->remotes)
        return HM2_ERR_NOMEM;
    int err = sserial_bind_port(setup, port);
    for (unsigned channel = 0; err == 0 && channel < SSLBP_CHANNELS; channel++) {
        if (!(found->mask >> channel & 1u))
            continue;
        struct sserial_remote *const remote = &port->remotes[port->remote_count++];
        remote->channel = channel;
        port->engine.channel[channel].identity = found->identity[channel];
        port->engine.channel[channel].mode = (uint8_t)sserial_mode(setup, port->number, channel);
        err = sserial_bind_remote(setup, access, remote, found->prefix[channel], found->tables[channel]);
    }
    return err;
}

/* One port: its remotes and their points, or nothing when there are none. */
static int setup_port(struct hm2_module *const module, struct hm2_setup *const setup, const unsigned number,
                      const unsigned channels)
{
    struct sserial *const ctx = module->context;
    struct sserial_port *const port = &ctx->ports[ctx->port_count];
    struct sserial_found found = {0};
    char name[HM2_NAME_SIZE];
    (void)snprintf(name, sizeof name, "%s: smart-serial port %u", setup->prefix, number);
    struct sslbp_port access = {.bus = {setup, bus_read, bus_write, bus_now_ns}, .name = name};
    int err = sserial_find(module, setup, number, channels, &access, &found);
    if (err == 0 && found.mask) {
        ctx->port_count++;
        port->number = number;
        sslbp_engine_init(&port->engine);
        port->engine.mask = (uint8_t)found.mask;
        port->engine.minor = access.minor;
        err = bind_remotes(setup, port, &access, &found);
        if (err == 0) {
            measure(port, found.mask);
            port->doit_ns = doit_ns(port, setup->config->sserial_baudrate);
            err = claim(module, setup, number, found.mask);
        }
        if (err == 0)
            err = add_windows(setup->plan, port, &access, setup->diag);
        /* It lies idle until the cycle starts it. */
        if (err == 0)
            err = sslbp_port_stop(&access);
    }
    sserial_forget(&found);
    return err;
}

static int setup_ports(struct hm2_module *const module, struct hm2_setup *const setup,
                       const unsigned masks[SSERIAL_PORTS])
{
    int err = drive(module, setup, masks);
    for (unsigned i = 0; err == 0 && i < SSERIAL_PORTS; i++)
        if (masks[i])
            err = setup_port(module, setup, i, masks[i]);
    static const unsigned none[SSERIAL_PORTS] = {0};
    const int bad = drive(module, setup, none);
    return err < 0 ? err : bad;
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    unsigned masks[SSERIAL_PORTS] = {0}, used = 0;
    for (unsigned i = 0; i < module->md->instances && i < SSERIAL_PORTS; i++) {
        masks[i] = channels_to_use(module, setup, i);
        used += masks[i] != 0;
    }
    if (used == 0)
        return 0;
    struct sserial *const ctx = hm2_setup_alloc(setup, sizeof *ctx);
    if (!ctx)
        return HM2_ERR_NOMEM;
    ctx->ports = hm2_setup_alloc(setup, used * sizeof *ctx->ports);
    if (!ctx->ports)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    const int err = setup_ports(module, setup, masks);
    if (ctx->port_count == 0)
        module->context = NULL;
    return err;
}

static const char *output_name(const struct hm2_pd *const pd)
{
    static const char *const names[2][SSLBP_CHANNELS] = {
        {"tx0", "tx1", "tx2", "tx3", "tx4", "tx5", "tx6", "tx7"},
        {"txen0", "txen1", "txen2", "txen3", "txen4", "txen5", "txen6", "txen7"},
    };
    const unsigned kind = (pd->secondary_pin & 0x70u) >> 4;
    return (pd->secondary_pin & HM2_PIN_OUTPUT) && kind < 2 && channel_of(pd) < SSLBP_CHANNELS
               ? names[kind][channel_of(pd)]
               : NULL;
}

/* Interface registers 0 to 2, and 0 to 6 (hal-interface 1.5). */
static const struct hm2_md_variant variants[] = {{0, 6, 0x40, 0x3C}};
static const struct hm2_md_variant variants_b[] = {{0, 10, 0x40, 0x3FC}};

const struct hm2_module_type hm2_sserial_type = {
    .name = "sserial",
    .gtag = HM2_GTAG_SSERIAL,
    .variants = variants,
    .variant_count = sizeof variants / sizeof variants[0],
    .config_count = -1,
    .setup = setup,
    .start = sserial_restart,
    .unpack = sserial_unpack_all,
    .pack = sserial_pack_all,
    .write_lost = sserial_write_lost,
    .turn_ns = sserial_turn_ns,
    .unfinished = sserial_unfinished,
    .output_name = output_name,
    .groups = sserial_groups,
};

const struct hm2_module_type hm2_sserialb_type = {
    .name = "sserialb",
    .gtag = HM2_GTAG_SSERIALB,
    .variants = variants_b,
    .variant_count = sizeof variants_b / sizeof variants_b[0],
    .config_count = -1,
    .setup = setup,
    .start = sserial_restart,
    .unpack = sserial_unpack_all,
    .pack = sserial_pack_all,
    .write_lost = sserial_write_lost,
    .turn_ns = sserial_turn_ns,
    .unfinished = sserial_unfinished,
    .output_name = output_name,
    .groups = sserial_groups,
};
