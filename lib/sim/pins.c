/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Pads, wires between them, and watched outputs. */
#include "card_state.h"

#include <stdlib.h>

/* How far ahead outputs of ClockHigh are followed at once when something may depend on them. */
#define TRACE_WINDOW_CLK 4096

static unsigned port_width(const struct sim_card *const card)
{
    return card->idrom.port_width > 0 ? card->idrom.port_width : 1;
}

static enum sim_level fpga_drives(struct sim_card *const card, const unsigned io)
{
    struct sim_module *const m = card->ioport;
    if (!m || !m->ops->output)
        return SIM_FLOAT;
    sim_sync(m);
    return m->ops->output(m, io / port_width(card), SIM_PORT_PIN(io % port_width(card)));
}

static enum sim_level output_of(struct sim_module *const m, const unsigned unit, const uint8_t secondary_pin)
{
    if (!m || !m->ops->output)
        return SIM_LOW;
    sim_sync(m);
    return m->ops->output(m, unit, secondary_pin);
}

unsigned sim_pad_of(const struct hm2_idrom *const idrom, const uint8_t gtag, const unsigned unit,
                    const uint8_t secondary_pin)
{
    for (unsigned io = 0; io < idrom->pin_count; io++) {
        const struct hm2_pd *const pd = &idrom->pins[io];
        if (pd->secondary_tag == gtag && pd->secondary_unit == unit && pd->secondary_pin == secondary_pin)
            return io;
    }
    return SIM_NO_PAD;
}

void sim_pins_connect(struct sim_card *const card)
{
    for (unsigned io = 0; io < card->idrom.pin_count; io++) {
        const struct hm2_pd *const pd = &card->idrom.pins[io];
        const bool has_output = pd->secondary_tag != HM2_GTAG_NONE && (pd->secondary_pin & HM2_PIN_OUTPUT);
        card->pads[io].alternate = has_output ? sim_module_of(card, pd->secondary_tag) : NULL;
    }
}

enum sim_level sim_alternate(struct sim_card *const card, const unsigned io)
{
    if (card->assuming && card->assumed_io == io)
        return card->assumed_level;
    struct sim_module *const m = io < HM2_MAX_PINS ? card->pads[io].alternate : NULL;
    const struct hm2_pd *const pd = &card->idrom.pins[m ? io : 0];
    return output_of(m, pd->secondary_unit, pd->secondary_pin);
}

enum sim_level sim_pad_level(struct sim_card *const card, const unsigned io)
{
    if (io >= card->idrom.pin_count)
        return SIM_FLOAT;
    const enum sim_level driven = fpga_drives(card, io);
    return driven != SIM_FLOAT ? driven : sim_pad_outside(card, io);
}

enum sim_level sim_pad_outside(const struct sim_card *const card, const unsigned io)
{
    if (io >= card->idrom.pin_count)
        return SIM_FLOAT;
    return card->pads[io].outside == SIM_PULLUP ? SIM_HIGH : card->pads[io].outside;
}

enum sim_level sim_card_pad(struct sim_card *const card, const unsigned io)
{
    return io < card->idrom.pin_count ? fpga_drives(card, io) : SIM_FLOAT;
}

/* ---- inputs -------------------------------------------------------------------------------------------------------
 */

static void deliver(struct sim_card *const card, const unsigned io, const enum sim_level level)
{
    const struct hm2_pd *const pd = &card->idrom.pins[io];
    if (pd->secondary_tag == HM2_GTAG_NONE || (pd->secondary_pin & HM2_PIN_OUTPUT))
        return;
    struct sim_module *const m = sim_module_of(card, pd->secondary_tag);
    if (!m || !m->ops->input)
        return;
    sim_sync(m);
    m->ops->input(m, pd->secondary_unit, pd->secondary_pin, level == SIM_HIGH);
}

static void look_at_pad(struct sim_card *const card, const unsigned io)
{
    const enum sim_level level = sim_pad_level(card, io);
    if (level == card->pads[io].shown)
        return;
    card->pads[io].shown = level;
    deliver(card, io, level);
}

/* Wires carry on what changed. A chain of n wires is through after n rounds; there are no rings. */
static void settle_wires(struct sim_card *const card)
{
    for (unsigned round = 0; round < card->wire_count; round++) {
        bool changed = false;
        for (unsigned i = 0; i < card->wire_count; i++) {
            const struct sim_wire *const wire = &card->wires[i];
            look_at_pad(card, wire->from);
            const enum sim_level level = card->pads[wire->from].shown;
            if (card->pads[wire->to].outside == level)
                continue;
            card->pads[wire->to].outside = level;
            look_at_pad(card, wire->to);
            changed = true;
        }
        if (!changed)
            return;
    }
}

void sim_pins_power_up(struct sim_card *const card)
{
    for (unsigned io = 0; io < card->idrom.pin_count; io++) {
        card->pads[io].shown = sim_pad_level(card, io);
        deliver(card, io, card->pads[io].shown);
    }
    card->pads_stale = true;
    sim_pins_settle(card, card->clk);
}

int sim_card_drive(struct sim_card *const card, const int64_t clk, const unsigned io, const enum sim_level level)
{
    if (io >= card->idrom.pin_count)
        return HM2_ERR_RANGE;
    sim_card_advance(card, clk + 1);
    card->pads[io].outside = level;
    look_at_pad(card, io);
    settle_wires(card);
    return 0;
}

int sim_drive_input_at(struct sim_card *const card, const int64_t clk, const unsigned ps, const uint8_t gtag,
                       const unsigned unit, const uint8_t secondary_pin, const enum sim_level level)
{
    struct sim_module *const m = sim_module_of(card, gtag);
    if (!m || (!m->ops->input && !m->ops->input_at))
        return HM2_ERR_NOTFOUND;
    if (secondary_pin & HM2_PIN_OUTPUT)
        return HM2_ERR_INVALID;
    const bool high = level == SIM_HIGH || level == SIM_PULLUP;
    sim_card_advance(card, m->ops->input_at ? clk : clk + 1);
    sim_sync(m);
    if (m->ops->input_at)
        m->ops->input_at(m, unit, secondary_pin, high, clk, ps);
    else
        m->ops->input(m, unit, secondary_pin, high);
    return 0;
}

int sim_card_drive_input(struct sim_card *const card, const int64_t clk, const uint8_t gtag, const unsigned unit,
                         const uint8_t secondary_pin, const enum sim_level level)
{
    return sim_drive_input_at(card, clk, 0, gtag, unit, secondary_pin, level);
}

/* ---- watched outputs ----------------------------------------------------------------------------------------------
 */

static enum sim_level level_of(struct sim_card *const card, const struct sim_watch *const watch)
{
    return watch->is_pad ? fpga_drives(card, watch->io) : output_of(watch->module, watch->unit, watch->secondary_pin);
}

static void report(struct sim_card *const card, const unsigned number, const int64_t clk, const unsigned ps,
                   const enum sim_level level)
{
    struct sim_watch *const watch = &card->watches[number];
    if (watch->level == level)
        return;
    watch->level = level;
    if (card->on_edge)
        card->on_edge(card->on_edge_context, clk, ps, number, level);
}

static void look_at_all_pads(struct sim_card *const card)
{
    card->pads_stale = false;
    for (unsigned io = 0; io < card->idrom.pin_count; io++)
        look_at_pad(card, io);
    for (unsigned i = 0; i < card->module_count; i++) {
        struct sim_module *const m = &card->modules[i];
        if (!m->ops->ports_changed)
            continue;
        sim_sync(m);
        m->ops->ports_changed(m);
    }
}

void sim_pins_settle(struct sim_card *const card, const int64_t clk)
{
    if (card->pads_stale)
        look_at_all_pads(card);
    settle_wires(card);
    for (unsigned i = 0; i < card->watch_count; i++)
        report(card, i, clk, 0, level_of(card, &card->watches[i]));
}

struct first_change {
    int64_t clk;
};

static void note_first(void *const context, const int64_t clk, const unsigned ps, const enum sim_level level)
{
    (void)ps;
    (void)level;
    struct first_change *const first = context;
    if (clk < first->clk)
        first->clk = clk;
}

static int64_t next_traced(struct sim_card *const card, struct sim_module *const m, const unsigned unit,
                           const uint8_t secondary_pin, const int64_t until)
{
    const int64_t horizon = card->clk + TRACE_WINDOW_CLK;
    const int64_t to = horizon < until ? horizon : until;
    struct first_change first = {.clk = to < until ? to - 1 : until};
    m->ops->trace(m, unit, secondary_pin, card->clk, to, note_first, &first);
    return first.clk;
}

static int64_t next_of_wires(struct sim_card *const card, int64_t until)
{
    for (unsigned i = 0; i < card->wire_count; i++) {
        const unsigned io = card->wires[i].from;
        struct sim_module *const m = card->pads[io].alternate;
        if (!m || !m->ops->trace)
            continue;
        const struct hm2_pd *const pd = &card->idrom.pins[io];
        sim_sync(m);
        until = next_traced(card, m, pd->secondary_unit, pd->secondary_pin, until);
    }
    return until;
}

int64_t sim_pins_next_event(struct sim_card *const card, int64_t until)
{
    for (unsigned i = 0; i < card->watched_count; i++) {
        struct sim_module *const m = card->watched[i];
        sim_sync(m);
        if (!m->ops->next_event || m->ops->trace)
            continue;
        const int64_t event = m->ops->next_event(m);
        if (event < until)
            until = event > card->clk ? event : card->clk;
    }
    /* Watched outputs of ClockHigh are traced over the whole stretch; only a wire hands them on within it. */
    return next_of_wires(card, until);
}

struct trace_report {
    struct sim_card *card;
    unsigned number;
    enum sim_level low, high; /* what the pad shows for the two levels of the output */
};

static void report_traced(void *const context, const int64_t clk, const unsigned ps, const enum sim_level level)
{
    const struct trace_report *const to = context;
    report(to->card, to->number, clk, ps, level == SIM_HIGH ? to->high : to->low);
}

/* What a pad would show if the output behind it had this level. Port registers change only at writes, and no write
 * lies within a trace. */
static enum sim_level pad_if(struct sim_card *const card, const unsigned io, const enum sim_level alternate)
{
    card->assuming = true;
    card->assumed_io = io;
    card->assumed_level = alternate;
    const enum sim_level level = fpga_drives(card, io);
    card->assuming = false;
    return level;
}

bool sim_pad_carries_alternate(struct sim_card *const card, const unsigned io)
{
    return io < card->idrom.pin_count && pad_if(card, io, SIM_LOW) != pad_if(card, io, SIM_HIGH);
}

void sim_pins_trace(struct sim_card *const card, const int64_t to)
{
    for (unsigned i = 0; i < card->watch_count; i++) {
        const struct sim_watch *const watch = &card->watches[i];
        if (!watch->module || !watch->module->ops->trace)
            continue;
        struct trace_report context = {.card = card, .number = i, .low = SIM_LOW, .high = SIM_HIGH};
        if (watch->is_pad) {
            context.low = pad_if(card, watch->io, SIM_LOW);
            context.high = pad_if(card, watch->io, SIM_HIGH);
        }
        watch->module->ops->trace(watch->module, watch->unit, watch->secondary_pin, card->clk, to, report_traced,
                                  &context);
    }
}

static int add_watch(struct sim_card *const card, struct sim_watch watch)
{
    struct sim_watch *const more = realloc(card->watches, (card->watch_count + 1) * sizeof *more);
    if (!more)
        return HM2_ERR_NOMEM;
    card->watches = more;
    if (watch.module)
        sim_watch_module(watch.module);
    watch.level = level_of(card, &watch);
    more[card->watch_count] = watch;
    return (int)card->watch_count++;
}

int sim_card_watch_pad(struct sim_card *const card, const unsigned io)
{
    if (io >= card->idrom.pin_count)
        return HM2_ERR_RANGE;
    const struct hm2_pd *const pd = &card->idrom.pins[io];
    return add_watch(card, (struct sim_watch){.is_pad = true,
                                              .io = io,
                                              .module = card->pads[io].alternate,
                                              .unit = pd->secondary_unit,
                                              .secondary_pin = pd->secondary_pin});
}

int sim_card_watch_output(struct sim_card *const card, const uint8_t gtag, const unsigned unit,
                          const uint8_t secondary_pin)
{
    struct sim_module *const m = sim_module_of(card, gtag);
    if (!m || !m->ops->output)
        return HM2_ERR_NOTFOUND;
    if (!(secondary_pin & HM2_PIN_OUTPUT))
        return HM2_ERR_INVALID;
    return add_watch(card, (struct sim_watch){.module = m, .unit = unit, .secondary_pin = secondary_pin});
}

enum sim_level sim_card_watched(struct sim_card *const card, const unsigned watch)
{
    return watch < card->watch_count ? card->watches[watch].level : SIM_FLOAT;
}

void sim_card_on_edge(struct sim_card *const card, const sim_edge_fn fn, void *const context)
{
    card->on_edge = fn;
    card->on_edge_context = context;
}

/* ---- wires --------------------------------------------------------------------------------------------------------
 */

static const struct sim_wire *wire_into(const struct sim_card *const card, const unsigned io)
{
    for (unsigned i = 0; i < card->wire_count; i++)
        if (card->wires[i].to == io)
            return &card->wires[i];
    return NULL;
}

int sim_card_wire(struct sim_card *const card, const unsigned from_io, const unsigned to_io)
{
    if (from_io >= card->idrom.pin_count || to_io >= card->idrom.pin_count)
        return HM2_ERR_RANGE;
    if (from_io == to_io || wire_into(card, to_io))
        return HM2_ERR_STATE;
    for (const struct sim_wire *up = wire_into(card, from_io); up; up = wire_into(card, up->from))
        if (up->from == to_io)
            return HM2_ERR_STATE; /* a ring */
    struct sim_wire *const more = realloc(card->wires, (card->wire_count + 1) * sizeof *more);
    if (!more)
        return HM2_ERR_NOMEM;
    card->wires = more;
    more[card->wire_count++] = (struct sim_wire){.from = from_io, .to = to_io};
    struct sim_module *const source = card->pads[from_io].alternate;
    if (source)
        sim_watch_module(source);
    settle_wires(card);
    return 0;
}

void sim_pins_release(struct sim_card *const card)
{
    free(card->watches);
    free(card->wires);
}
