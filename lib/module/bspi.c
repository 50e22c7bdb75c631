/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Buffered SPI: see hm2/bspi.h for what it offers. */
#include <hm2/bspi.h>

#include <math.h>

#include "bind.h"
#include "module_types.h"

enum { REG_FIFO, REG_DESCRIPTORS, REG_COUNT };

#define CHANNEL_STRIDE 4u
#define PORT_STRIDE    4u /* of descriptors and counts, whatever the descriptor's stride says (register map 3.10) */
#define COUNT_MASK     0x1Fu
#define WAITING        16u
#define MAX_DIVIDER    255.0
#define MAX_DELAY      15.0

/* Descriptor word (register map 3.10). */
#define D_CPOL     (1u << 6)
#define D_CPHA     (1u << 7)
#define D_DIVIDER  8
#define D_SELECT   16
#define D_DELAY    24
#define D_NO_DELAY 0x10u
#define D_LATE     (1u << 29)
#define D_KEEP     (1u << 30)
#define D_NO_ECHO  (1u << 31)

struct frame {
    uint32_t out, in;
    uint8_t channel;
    bool echo;
    struct hm2_window write, read;
};

struct waiting {
    uint32_t word;
    uint8_t channel;
};

struct hm2_bspi {
    struct hm2_plan *plan;
    double clock_hz;
    uint16_t fifo, count;
    bool known[HM2_BSPI_CHANNELS];
    struct hm2_section descriptors; /* channel 15 first */
    struct hm2_window clear, received;
    unsigned frames, echoes;
    struct frame frame[HM2_BSPI_FRAMES];
    struct hm2_section once; /* a word that is sent once */
    bool underway;
    uint32_t put, got; /* of waiting */
    struct waiting waiting[WAITING];
    bool filled; /* the last write had frames, so a reply has their echoes */
    uint32_t short_cycles;
    bool unfinished; /* the last reply was short */
    hm2_bspi_fn read_function, write_function;
    void *read_context, *write_context;
};

struct bspis {
    struct hm2_bspi *port;
};

static const struct hm2_md_variant variants[] = {{0, 3, 0x40, 0x07}};

/* No points: what a port sends is the affair of whoever knows what is connected to it. */
static const struct hm2_point_group groups[] = {{NULL, NULL, 0, NULL}};

static int setup_port(struct hm2_bspi *const port, const struct hm2_module *const module,
                      const struct hm2_setup *const setup, const unsigned unit)
{
    const struct hm2_md *const md = module->md;
    port->plan = setup->plan;
    port->clock_hz = md->clock_hz;
    port->fifo = hm2_md_address(md, REG_FIFO, unit);
    port->count = (uint16_t)(hm2_md_address(md, REG_COUNT, 0) + PORT_STRIDE * unit);
    const uint16_t descriptors = (uint16_t)(hm2_md_address(md, REG_DESCRIPTORS, 0) + PORT_STRIDE * unit);
    const int err = hm2_plan_add_setup(setup->plan, &port->descriptors, HM2_RANK_NORMAL, descriptors, HM2_BSPI_CHANNELS,
                                       HM2_SECTION_FIFO, setup->diag);
    return err ? err
               : hm2_plan_add_setup(setup->plan, &port->once, HM2_RANK_LAST, port->fifo, 1, HM2_SECTION_ON_DEMAND,
                                    setup->diag);
}

/* Outputs count from 0x81, the selects from 0x85: 0x84 would be the input. */
static const char *output_name(const struct hm2_pd *const pd)
{
    static const char *const names[] = {"nframe", "out", "clk", NULL,  "cs0", "cs1",
                                        "cs2",    "cs3", "cs4", "cs5", "cs6", "cs7"};
    const unsigned number = pd->secondary_pin - (HM2_PIN_OUTPUT | 1u);
    return number < sizeof names / sizeof names[0] ? names[number] : NULL;
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    if (module->instances == 0)
        return 0;
    struct bspis *const ctx = hm2_setup_alloc(setup, sizeof *ctx);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    ctx->port = hm2_setup_alloc(setup, module->instances * sizeof *ctx->port);
    if (!ctx->port)
        return HM2_ERR_NOMEM;
    int err = hm2_claim_pins(module, setup, HM2_GTAG_NONE, module->instances, true, NULL);
    for (unsigned unit = 0; err == 0 && unit < module->instances; unit++)
        err = setup_port(&ctx->port[unit], module, setup, unit);
    return err;
}

/* ---- for those who use a port -------------------------------------------------------------------------------------
 */

struct hm2_bspi *hm2_bspi_port(struct hm2_board *const board, const unsigned unit)
{
    const struct hm2_module *const module = hm2_board_module(board, HM2_GTAG_BSPI);
    const struct bspis *const ctx = module ? module->context : NULL;
    return ctx && unit < module->instances ? &ctx->port[unit] : NULL;
}

static uint32_t descriptor(const struct hm2_bspi *const port, const struct hm2_bspi_channel *const s)
{
    const double board_mhz = port->clock_hz * 1e-6;
    const double mhz = s->mhz < board_mhz / 2.0 ? s->mhz : board_mhz / 2.0;
    const double divider = fmin(fmax(board_mhz / (2.0 * mhz) - 1.0, 0.0), MAX_DIVIDER);
    const double clocks = fmin(fmax(s->delay_ns * board_mhz / 1000.0 - 1.0, 0.0), MAX_DELAY);
    const uint32_t delay = s->delay_ns ? (uint32_t)clocks : D_NO_DELAY;
    return (s->bits - 1u) | (s->cpol ? D_CPOL : 0) | (s->cpha ? D_CPHA : 0) | (uint32_t)divider << D_DIVIDER |
           s->chip_select << D_SELECT | delay << D_DELAY | (s->sample_late ? D_LATE : 0) |
           (s->keep_frame ? D_KEEP : 0) | (s->no_echo ? D_NO_ECHO : 0);
}

int hm2_bspi_set_channel(struct hm2_bspi *const port, const unsigned channel,
                         const struct hm2_bspi_channel *const settings, struct hm2_diag *const diag)
{
    if (channel >= HM2_BSPI_CHANNELS)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "BSPI channel %u: channels are 0 to %u", channel,
                            HM2_BSPI_CHANNELS - 1u);
    if (settings->chip_select > 15 || settings->bits < 1 || settings->bits > 32)
        return hm2_diag_add(diag, HM2_ERR_RANGE,
                            "BSPI channel %u: chip select %u and %u bits found, chip selects are 0 to 15, and the "
                            "firmware sends 1 to 32 bits",
                            channel, settings->chip_select, settings->bits);
    if (!(settings->mhz > 0.0) || !isfinite(settings->mhz))
        return hm2_diag_add(diag, HM2_ERR_RANGE, "BSPI channel %u: a clock of %g MHz cannot be made", channel,
                            settings->mhz);
    port->known[channel] = true;
    hm2_section_set(&port->descriptors, HM2_BSPI_CHANNELS - 1u - channel, descriptor(port, settings));
    return 0;
}

bool hm2_bspi_channel_known(const struct hm2_bspi *const port, const unsigned channel)
{
    return channel < HM2_BSPI_CHANNELS && port->known[channel];
}

static uint16_t address_of(const struct hm2_bspi *const port, const unsigned channel)
{
    return (uint16_t)(port->fifo + CHANNEL_STRIDE * channel);
}

/* What every port with frames has: an emptied FIFO before them, and the number of words that came back. */
static int add_frame_care(struct hm2_bspi *const port, struct hm2_diag *const diag)
{
    const int err = hm2_plan_add_queue_write(port->plan, &port->clear, port->count, 1, diag);
    return err ? err : hm2_plan_add_queue_read(port->plan, &port->received, port->count, 1, diag);
}

int hm2_bspi_add_frame(struct hm2_bspi *const port, const unsigned channel, uint32_t **const out, uint32_t **const in,
                       struct hm2_diag *const diag)
{
    if (!hm2_bspi_channel_known(port, channel))
        return hm2_diag_add(diag, HM2_ERR_STATE, "BSPI channel %u is used before it was set", channel);
    if (port->frames == HM2_BSPI_FRAMES)
        return hm2_diag_add(diag, HM2_ERR_NOSPACE, "more than %u BSPI frames in a cycle", HM2_BSPI_FRAMES);
    struct frame *const frame = &port->frame[port->frames];
    frame->channel = (uint8_t)channel;
    frame->echo = !(hm2_section_get(&port->descriptors, HM2_BSPI_CHANNELS - 1u - channel) & D_NO_ECHO);
    int err = port->frames == 0 ? add_frame_care(port, diag) : 0;
    if (!err)
        err = hm2_plan_add_queue_write(port->plan, &frame->write, address_of(port, channel), 1, diag);
    if (!err && frame->echo)
        err = hm2_plan_add_queue_read(port->plan, &frame->read, port->fifo, 1, diag);
    if (err)
        return err;
    port->frames++;
    port->echoes += frame->echo;
    *out = &frame->out;
    if (in)
        *in = frame->echo ? &frame->in : NULL;
    return 0;
}

bool hm2_bspi_send(struct hm2_bspi *const port, const unsigned channel, const uint32_t word)
{
    if (port->put - port->got >= WAITING || channel >= HM2_BSPI_CHANNELS)
        return false;
    port->waiting[port->put++ % WAITING] = (struct waiting){word, (uint8_t)channel};
    return true;
}

void hm2_bspi_on_read(struct hm2_bspi *const port, const hm2_bspi_fn function, void *const context)
{
    port->read_context = context;
    port->read_function = function;
}

void hm2_bspi_on_write(struct hm2_bspi *const port, const hm2_bspi_fn function, void *const context)
{
    port->write_context = context;
    port->write_function = function;
}

uint32_t hm2_bspi_short_cycles(const struct hm2_bspi *const port)
{
    return port->short_cycles;
}

/* ---- cycle ---------------------------------------------------------------------------------------------------------
 */

static void take_echoes(struct hm2_bspi *const port)
{
    port->unfinished = (hm2_window_get(&port->received, 0) & COUNT_MASK) < port->echoes;
    if (port->unfinished) {
        port->short_cycles++;
        return;
    }
    for (struct frame *frame = port->frame, *const end = frame + port->frames; frame < end; frame++)
        if (frame->echo)
            frame->in = hm2_window_get(&frame->read, 0);
}

static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct bspis *const ctx = module->context;
    (void)cycle;
    for (struct hm2_bspi *port = ctx->port, *const end = port + module->instances; port < end; port++) {
        if (port->filled && port->echoes > 0)
            take_echoes(port);
        if (port->read_function)
            (void)port->read_function(port->read_context);
    }
}

#define FRAME_CLOCKS 64u /* besides its bits: delays of up to 16 clocks before and behind it, and a reserve */

static double frame_clocks(const struct hm2_bspi *const port, const unsigned channel)
{
    const uint32_t d = hm2_section_get(&port->descriptors, HM2_BSPI_CHANNELS - 1u - channel);
    return (double)((d & 0x1Fu) + 1u) * 2.0 * (double)((d >> D_DIVIDER & 0xFFu) + 1u) + FRAME_CLOCKS;
}

/* Of all frames, and of a word that is sent once between them. */
static int64_t port_turn_ns(const struct hm2_bspi *const port)
{
    double clocks = 0.0, longest = 0.0;
    for (unsigned i = 0; i < port->frames; i++) {
        const double frame = frame_clocks(port, port->frame[i].channel);
        clocks += frame;
        longest = fmax(longest, frame);
    }
    return (int64_t)((clocks + longest) * 1e9 / port->clock_hz);
}

static int64_t turn_ns(const struct hm2_module *const module)
{
    const struct bspis *const ctx = module->context;
    int64_t longest = 0;
    for (unsigned unit = 0; ctx && unit < module->instances; unit++) {
        const int64_t ns = port_turn_ns(&ctx->port[unit]);
        longest = ns > longest ? ns : longest;
    }
    return longest;
}

static bool unfinished(const struct hm2_module *const module)
{
    const struct bspis *const ctx = module->context;
    for (unsigned unit = 0; ctx && unit < module->instances; unit++)
        if (ctx->port[unit].unfinished)
            return true;
    return false;
}

/* The packet that carried the frames did not arrive, so nothing came back. */
static void write_lost(struct hm2_module *const module)
{
    const struct bspis *const ctx = module->context;
    for (unsigned unit = 0; ctx && unit < module->instances; unit++)
        ctx->port[unit].filled = false;
}

static void send_waiting(struct hm2_bspi *const port, const bool ready)
{
    port->underway = port->underway && !hm2_section_confirmed(&port->once);
    if (!ready || port->underway || port->put == port->got)
        return;
    const struct waiting *const next = &port->waiting[port->got++ % WAITING];
    hm2_section_move(&port->once, address_of(port, next->channel));
    hm2_section_set(&port->once, 0, next->word);
    hm2_section_touch(&port->once);
    port->underway = true;
}

/* The port takes the descriptor of a word when its turn comes: while descriptors are still on their way behind the
 * frames, a word would go out in a wrong way and to a wrong chip. */
static void send_frames(struct hm2_bspi *const port, const bool ready)
{
    for (struct frame *frame = port->frame, *const end = frame + port->frames; frame < end; frame++) {
        hm2_window_set(&frame->write, 0, frame->out);
        hm2_put_le16(frame->write.address, ready ? address_of(port, frame->channel) : HM2_PLAN_NOWHERE);
    }
    port->filled = ready && port->frames > 0;
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct bspis *const ctx = module->context;
    (void)cycle;
    for (struct hm2_bspi *port = ctx->port, *const end = port + module->instances; port < end; port++) {
        if (port->write_function)
            (void)port->write_function(port->write_context);
        const bool ready = hm2_section_confirmed(&port->descriptors);
        send_frames(port, ready);
        send_waiting(port, ready);
    }
}

const struct hm2_module_type hm2_bspi_type = {
    .name = "bspi",
    .gtag = HM2_GTAG_BSPI,
    .variants = variants,
    .variant_count = sizeof variants / sizeof variants[0],
    .config_count = HM2_CFG_BSPIS,
    .setup = setup,
    .unpack = unpack,
    .pack = pack,
    .write_lost = write_lost,
    .turn_ns = turn_ns,
    .unfinished = unfinished,
    .output_name = output_name,
    .groups = groups,
};
