/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the files of the card's core share. Models see sim_card.h only. */
#ifndef SIM_CARD_STATE_H
#define SIM_CARD_STATE_H

#include "sim_card.h"

#define SIM_PAGES 256u

struct sim_profile;
struct sim_lbp16;

struct sim_pad {
    struct sim_module *alternate; /* makes the level of the secondary output; NULL when there is none */
    enum sim_level outside;       /* what the world does to it */
    enum sim_level shown;         /* what the FPGA last saw there */
};

struct sim_watch {
    bool is_pad;
    unsigned io;               /* when is_pad */
    struct sim_module *module; /* source of the level; NULL for a pad without one */
    unsigned unit;
    uint8_t secondary_pin;
    enum sim_level level; /* as last reported */
};

struct sim_wire {
    unsigned from, to;
};

struct sim_card {
    const struct sim_profile *profile;
    struct hm2_image image; /* writable: the IDROM is a RAM (register map 1.2) */
    struct hm2_idrom idrom; /* as at configuration */
    uint32_t undriven_value;
    bool later_sources;
    bool idrom_writable;
    int64_t clk;

    unsigned module_count;
    struct sim_module modules[HM2_MAX_MODULES];
    unsigned watched_count;
    struct sim_module *watched[HM2_MAX_MODULES]; /* whose next_event() matters */
    struct sim_module *page_owner[SIM_PAGES];
    struct sim_module *ioport;
    bool pads_stale; /* port registers may have changed since the pads were looked at */

    bool assuming; /* the question is what a pad would show with its secondary output at assumed_level */
    unsigned assumed_io;
    enum sim_level assumed_level;

    struct sim_pad pads[HM2_MAX_PINS];
    unsigned watch_count, wire_count;
    struct sim_watch *watches;
    struct sim_wire *wires;
    sim_edge_fn on_edge;
    void *on_edge_context;

    struct sim_lbp16 *lbp16;
};

/* card.c */
void sim_sync(struct sim_module *m);         /* advance to the card's present clk */
void sim_card_reload(struct sim_card *card); /* as the ICAP asked */

/* pins.c */
void sim_pins_connect(struct sim_card *card); /* once, when all modules are there */
void sim_pins_power_up(struct sim_card *card);
void sim_pins_release(struct sim_card *card);
/* Look at every watched output and every stale pad; changes are those of edge clk. */
void sim_pins_settle(struct sim_card *card, int64_t clk);
/* First edge in [card->clk, until) after which something that is watched may change; `until` when none. */
int64_t sim_pins_next_event(struct sim_card *card, int64_t until);
/* Report the changes of outputs clocked by ClockHigh in [card->clk, to). */
void sim_pins_trace(struct sim_card *card, int64_t to);

/* image.c: what an image says, however wrong it is; never refuses. */
void sim_image_read(const struct hm2_image *image, struct hm2_idrom *idrom);

#endif
