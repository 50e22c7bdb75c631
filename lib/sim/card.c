/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The card as a register bus: modules behind their pages, and the clock that all of them share. */
#include "card_state.h"

#include <stdlib.h>
#include <string.h>

#include <hm2/lbp16.h>

#include "lbp16_engine.h"
#include "map.h"
#include "profiles.h"

#define PAGE_SHIFT       8
#define PAGE_ID          (HM2_ADDR_COOKIE >> PAGE_SHIFT)
#define PAGE_IDROM_GUARD 0x08u /* bit 0 = IDROM write enable (register map 1.2) */
#define IDROM_PAGES      4u

/* ---- time ---------------------------------------------------------------------------------------------------------
 */

void sim_sync(struct sim_module *const m)
{
    const int64_t clk = m->card->clk;
    if (m->clk >= clk)
        return;
    if (m->ops->advance)
        m->ops->advance(m, clk);
    if (m->clk < clk)
        m->clk = clk;
}

static void sync_watched(struct sim_card *const card)
{
    for (unsigned i = 0; i < card->watched_count; i++)
        sim_sync(card->watched[i]);
}

/* All edges before clk happen; after each edge that somebody may see, everybody looks. */
static void run_to(struct sim_card *const card, const int64_t clk)
{
    while (card->clk < clk) {
        const int64_t event = sim_pins_next_event(card, clk);
        const int64_t to = event < clk ? event + 1 : clk;
        sim_pins_trace(card, to);
        card->clk = to;
        sync_watched(card);
        sim_pins_settle(card, to - 1);
    }
}

int64_t sim_card_clock(const struct sim_card *const card)
{
    return card->clk;
}

int64_t sim_now(const struct sim_card *const card)
{
    return card->clk;
}

void sim_card_advance(struct sim_card *const card, const int64_t clk)
{
    run_to(card, clk);
}

/* ---- registers ----------------------------------------------------------------------------------------------------
 */

/* The IDROM answers on 1 KiB from where the pointer register says (register map 1.2). */
static bool idrom_word(const struct sim_card *const card, const uint16_t address, unsigned *const word)
{
    const unsigned first_page = (card->image.id[3] & 0xFC00u) >> PAGE_SHIFT;
    const unsigned page = address >> PAGE_SHIFT;
    *word = (address & 0x3FFu) / 4;
    return page >= first_page && page < first_page + IDROM_PAGES;
}

static uint32_t read_module(struct sim_card *const card, const uint16_t address, uint32_t *const undriven)
{
    struct sim_module *const m = card->page_owner[address >> PAGE_SHIFT];
    if (!m || !m->ops->read) {
        *undriven = UINT32_MAX;
        return 0;
    }
    sim_sync(m);
    return m->ops->read(m, (unsigned)((address - m->md.base) >> PAGE_SHIFT), address & 0xFCu, undriven);
}

uint32_t sim_card_read(struct sim_card *const card, const int64_t clk, const uint16_t address, uint32_t *const undriven)
{
    run_to(card, clk);
    uint32_t floating = 0;
    uint32_t value;
    unsigned word;
    if (address >> PAGE_SHIFT == PAGE_ID)
        value = card->image.id[address / 4 & 3u]; /* only bits 3..2 are decoded (register map 1.1) */
    else if (idrom_word(card, address, &word))
        value = card->image.rom[word];
    else if (address >> PAGE_SHIFT == PAGE_IDROM_GUARD)
        value = card->idrom_writable;
    else
        value = read_module(card, address, &floating);
    if (undriven)
        *undriven = floating;
    return (value & ~floating) | (card->undriven_value & floating);
}

static void write_module(struct sim_card *const card, const uint16_t address, const uint32_t value)
{
    struct sim_module *const m = card->page_owner[address >> PAGE_SHIFT];
    if (!m || !m->ops->write)
        return;
    sim_sync(m);
    m->ops->write(m, (unsigned)((address - m->md.base) >> PAGE_SHIFT), address & 0xFCu, value);
}

void sim_card_write(struct sim_card *const card, const int64_t clk, const uint16_t address, const uint32_t value)
{
    run_to(card, clk);
    unsigned word;
    if (idrom_word(card, address, &word)) {
        if (card->idrom_writable)
            card->image.rom[word] = value;
    } else if (address >> PAGE_SHIFT == PAGE_IDROM_GUARD) {
        card->idrom_writable = value & 1u;
    } else {
        write_module(card, address, value);
    }
    /* The write happened at this edge: what it changed shows just after it. */
    run_to(card, card->clk + 1);
}

/* ---- what models ask ----------------------------------------------------------------------------------------------
 */

uint32_t sim_clock_low_hz(const struct sim_card *const card)
{
    return card->idrom.clock_low_hz;
}

uint32_t sim_clock_high_hz(const struct sim_card *const card)
{
    return card->idrom.clock_high_hz;
}

const struct hm2_idrom *sim_idrom(const struct sim_card *const card)
{
    return &card->idrom;
}

bool sim_sources_are_later(const struct sim_card *const card)
{
    return card->later_sources;
}

const struct hm2_idrom *sim_card_idrom(const struct sim_card *const card)
{
    return &card->idrom;
}

struct sim_module *sim_module_of(struct sim_card *const card, const uint8_t gtag)
{
    for (unsigned i = 0; i < card->module_count; i++)
        if (card->modules[i].md.gtag == gtag)
            return &card->modules[i];
    return NULL;
}

void sim_watch_module(struct sim_module *const m)
{
    struct sim_card *const card = m->card;
    for (unsigned i = 0; i < card->watched_count; i++)
        if (card->watched[i] == m)
            return;
    card->watched[card->watched_count++] = m;
}

void sim_pads_changed(struct sim_card *const card)
{
    card->pads_stale = true;
}

struct sim_module *sim_find(struct sim_card *const card, const uint8_t gtag)
{
    struct sim_module *const m = sim_module_of(card, gtag);
    if (m)
        sim_sync(m);
    return m;
}

int sim_card_absolute(struct sim_card *const card, const uint8_t gtag, const unsigned unit,
                      const struct sim_absolute *const encoder)
{
    struct sim_module *const m = sim_find(card, gtag);
    if (!m || !m->ops->absolute)
        return HM2_ERR_NOTFOUND;
    if (encoder->bits > 128 || encoder->delay_ps < 0 || encoder->idle_ps < 0 || encoder->bit_ps < 0)
        return HM2_ERR_RANGE;
    return m->ops->absolute(m, unit, encoder);
}

void sim_bite(struct sim_card *const card)
{
    for (unsigned i = 0; i < card->module_count; i++) {
        struct sim_module *const m = &card->modules[i];
        if (!m->ops->bite)
            continue;
        sim_sync(m);
        m->ops->bite(m);
    }
    card->pads_stale = true;
}

/* ---- making and configuring ---------------------------------------------------------------------------------------
 */

static const struct sim_module_ops *model_for(const uint8_t gtag)
{
    for (const struct sim_module_ops *const *model = sim_models; *model; model++)
        if ((*model)->gtag == gtag)
            return *model;
    return NULL;
}

static void claim_pages(struct sim_card *const card, struct sim_module *const m, const unsigned pages)
{
    const unsigned first = m->md.base >> PAGE_SHIFT;
    for (unsigned i = 0; i < pages && first + i < SIM_PAGES; i++)
        if (!card->page_owner[first + i])
            card->page_owner[first + i] = m;
}

/* What a descriptor declares goes first: in the old map other modules lie where the registers that a newer module has
 * beyond its descriptor would be (WaveGen at the step generators' select register, for one; register map 2.2). */
static void claim_all_pages(struct sim_card *const card)
{
    for (unsigned i = 0; i < card->module_count; i++) {
        struct sim_module *const m = &card->modules[i];
        const unsigned declared = m->md.registers < m->ops->pages ? m->md.registers : m->ops->pages;
        claim_pages(card, m, declared);
    }
    for (unsigned i = 0; i < card->module_count; i++)
        claim_pages(card, &card->modules[i], card->modules[i].ops->pages);
}

static int add_module(struct sim_card *const card, const struct hm2_md *const md, struct hm2_diag *const diag)
{
    const struct sim_module_ops *const ops = model_for(md->gtag);
    if (!ops)
        return 0; /* its registers are driven by nobody */
    struct sim_module *const m = &card->modules[card->module_count];
    m->ops = ops;
    m->card = card;
    m->md = *md;
    if (ops->state_size > 0) {
        m->state = calloc(1, ops->state_size);
        if (!m->state)
            return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for the simulated %s", ops->name);
    }
    card->module_count++;
    const int err = ops->init ? ops->init(m) : 0;
    if (err)
        return hm2_diag_add(diag, err, "the simulated %s module refuses its descriptor (%u instances at 0x%04X): %s",
                            ops->name, md->instances, md->base, hm2_strerror(err));
    if (md->gtag == HM2_GTAG_IOPORT && !card->ioport)
        card->ioport = m;
    return 0;
}

/* The interrupt logic of cards with a DPLL answers whether or not a descriptor tells of it (the hm2dpll traces). */
static int add_hidden_modules(struct sim_card *const card, struct hm2_diag *const diag)
{
    static const struct hm2_md irq = {
        .gtag = HM2_GTAG_IRQ, .clock_tag = 1, .instances = 1, .base = 0x0900, .registers = 3};
    if (!sim_module_of(card, HM2_GTAG_DPLL) || sim_module_of(card, HM2_GTAG_IRQ) ||
        card->module_count >= HM2_MAX_MODULES)
        return 0;
    return add_module(card, &irq, diag);
}

static void power_up(struct sim_card *const card)
{
    card->idrom_writable = false;
    for (unsigned i = 0; i < card->module_count; i++) {
        struct sim_module *const m = &card->modules[i];
        m->clk = card->clk;
        if (m->ops->power_up)
            m->ops->power_up(m);
    }
    sim_pins_power_up(card);
}

static int build(struct sim_card *const card, const struct sim_card_options *const options, struct hm2_diag *const diag)
{
    const struct sim_profile *const profile = sim_profile_find(options->profile);
    if (!profile) {
        char known[768];
        sim_profile_list(known, sizeof known);
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "no simulated card is called \"%s\"; there are: %s",
                            options->profile ? options->profile : "", known);
    }
    const size_t name_len = options->card_name ? strlen(options->card_name) : 1;
    if (name_len < 1 || name_len > LBP16_INFO_NAME_BYTES)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "\"%s\" found, expected a card's name of 1 to %u characters",
                            options->card_name, LBP16_INFO_NAME_BYTES);
    card->profile = profile;
    if (options->image)
        card->image = *options->image;
    else
        sim_profile_image(profile, &card->image);
    sim_image_read(&card->image, &card->idrom);
    const enum sim_bus natural = profile->efinix ? SIM_BUS_ZEROS : SIM_BUS_ONES;
    const enum sim_bus bus = options->bus != SIM_BUS_OF_PROFILE ? options->bus : natural;
    card->undriven_value = bus == SIM_BUS_ONES ? UINT32_MAX : 0;
    card->later_sources = options->sources == SIM_SOURCES_LATER ||
                          (options->sources == SIM_SOURCES_OF_MAP && sim_map_is_new(&card->idrom));
    for (unsigned i = 0; i < card->idrom.module_count; i++) {
        const int err = add_module(card, &card->idrom.modules[i], diag);
        if (err)
            return err;
    }
    const int err = add_hidden_modules(card, diag);
    if (err)
        return err;
    claim_all_pages(card);
    sim_pins_connect(card);
    for (unsigned io = 0; io < HM2_MAX_PINS; io++)
        card->pads[io].outside = SIM_PULLUP;
    power_up(card);
    return sim_lbp16_new(&card->lbp16, card, options, diag);
}

int sim_card_new(struct sim_card **const card, const struct sim_card_options *const options,
                 struct hm2_diag *const diag)
{
    *card = NULL;
    struct sim_card *const made = calloc(1, sizeof *made);
    if (!made)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for a simulated card");
    const int err = build(made, options, diag);
    if (err) {
        sim_card_free(made);
        return err;
    }
    *card = made;
    return 0;
}

void sim_card_free(struct sim_card *const card)
{
    if (!card)
        return;
    for (unsigned i = 0; i < card->module_count; i++) {
        if (card->modules[i].ops->release)
            card->modules[i].ops->release(&card->modules[i]);
        free(card->modules[i].state);
    }
    sim_pins_release(card);
    sim_lbp16_free(card->lbp16);
    free(card);
}

void sim_card_power_cycle(struct sim_card *const card)
{
    power_up(card);
    sim_lbp16_power_up(card->lbp16);
}

void sim_card_reload(struct sim_card *const card)
{
    power_up(card);
    sim_lbp16_reload(card->lbp16);
}

void sim_card_power_off(struct sim_card *const card)
{
    power_up(card); /* no register keeps anything, no pin drives */
    sim_lbp16_power_off(card->lbp16);
}
