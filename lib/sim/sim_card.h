/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Inside of the simulated card: what a module model is and what it may ask of its card. See hm2/sim.h for time. */
#ifndef SIM_CARD_H
#define SIM_CARD_H

#include <limits.h>

#include <hm2/sim.h>

#define SIM_NEVER INT64_MAX

struct sim_module;
struct serial_feed;

/*
 * One kind of module. `clk` below is always card time: advance(m, clk) makes all edges before clk happen, in closed
 * form where nothing can be seen in between. Before read, write, output, input and next_event the card has advanced
 * the module to its own present clk; modules that nobody looks at are advanced late. The card sets m->clk after
 * advance() and calls it only when m->clk < clk; a model may also move m->clk on by itself (after a write that made
 * edge clk, say). Writes take their edge: after a write at clk the card's present clk is clk + 1.
 */
struct sim_module_ops {
    uint8_t gtag;
    const char *name;
    unsigned pages;    /* register pages it answers on, from md->base on (more than the IDROM declares) */
    size_t state_size; /* zeroed memory at m->state */
    /* Called once after m->md is set. May allocate more; 0 or an error. */
    int (*init)(struct sim_module *m);
    void (*release)(struct sim_module *m);              /* may be NULL */
    void (*power_up)(struct sim_module *m);             /* registers as after configuration, time = card's clk */
    void (*advance)(struct sim_module *m, int64_t clk); /* may be NULL for modules without time */
    /* page = register number (address - base) / 0x100; low = address & 0xFC. The module decodes low into instance as
     * its firmware does. *undriven: bits it does not drive. */
    uint32_t (*read)(struct sim_module *m, unsigned page, unsigned low, uint32_t *undriven);
    /* Happens at edge clk = card time: logic sees the old value at that edge, the new one from the next edge on. */
    void (*write)(struct sim_module *m, unsigned page, unsigned low, uint32_t value);
    /* Level of an output (secondary pin code, bit 7 set) as the edges so far have made it. */
    enum sim_level (*output)(struct sim_module *m, unsigned unit, uint8_t secondary_pin);
    /* An input changed just after the edge before the present clk. */
    /* Called for every input pin after power_up, too. unit is that of the pin descriptor: HM2_UNIT_GLOBAL = all
     * instances. A floating pad is low. */
    void (*input)(struct sim_module *m, unsigned unit, uint8_t secondary_pin, bool level);
    /* The same ps after edge clk, for models whose inputs ClockHigh samples; used instead of input when not NULL.
     * Present clk is still clk: edges of ClockHigh before the change are to come. */
    void (*input_at)(struct sim_module *m, unsigned unit, uint8_t secondary_pin, bool level, int64_t clk, unsigned ps);
    int (*absolute)(struct sim_module *m, unsigned unit, const struct sim_absolute *encoder); /* may be NULL */
    /* Earliest edge >= present clk after which a watched output may change (earlier is allowed, later is not);
     * SIM_NEVER when none is coming by itself. NULL = never. */
    int64_t (*next_event)(struct sim_module *m);
    /* Outputs clocked by ClockHigh: report every change in edges [from, to) of ClockLow, with picoseconds. Used
     * instead of next_event when not NULL. Called with m->clk == from, before advance(m, to); changes nothing. */
    void (*trace)(struct sim_module *m, unsigned unit, uint8_t secondary_pin, int64_t from, int64_t to,
                  void (*report)(void *context, int64_t clk, unsigned ps, enum sim_level level), void *context);
    /* Serial modules: who is told of each byte sent (transmitter), and where bytes from outside wait (receiver; NULL
     * when there is no such unit). */
    void (*serial_attach)(struct sim_module *m, unsigned unit, sim_serial_fn sent, void *context);
    struct serial_feed *(*serial_feed)(struct sim_module *m, unsigned unit);
    void (*bite)(struct sim_module *m); /* the watchdog bit: outputs that it clears. May be NULL */
    /* Port registers changed at the edge before the present clk, and with them, perhaps, which pads carry outputs of
     * the module. Called after power_up, too. May be NULL. */
    void (*ports_changed)(struct sim_module *m);
};

/* The card asks the IOPort model (one module, unit = port) for what it drives on bit b of a port as
 * output(m, port, SIM_PORT_PIN(b)): SIM_LOW, SIM_HIGH or SIM_FLOAT. The model in turn uses sim_alternate() for the
 * secondary function behind a pad and sim_pad_level() for what its data register reads. */
#define SIM_PORT_PIN(b) ((uint8_t)(HM2_PIN_OUTPUT | (b)))

struct sim_module {
    const struct sim_module_ops *ops;
    struct sim_card *card;
    struct hm2_md md;
    void *state;
    int64_t clk;    /* edges before this have been made */
    bool advancing; /* it is being advanced together with others, and tells the world outside what happens */
};

/* Every model, NULL-terminated; a new one is one line in lib/sim/models.c. */
extern const struct sim_module_ops *const sim_models[];

/* ---- what a model may ask of its card --------------------------------------------------------------------------- */

uint32_t sim_clock_low_hz(const struct sim_card *card);
uint32_t sim_clock_high_hz(const struct sim_card *card);
const struct hm2_idrom *sim_idrom(const struct sim_card *card);
/* Modules follow the later sources (enum sim_sources). */
bool sim_sources_are_later(const struct sim_card *card);
/* sim_card_drive_input() ps after edge clk. */
int HM2_MUST_CHECK sim_drive_input_at(struct sim_card *card, int64_t clk, unsigned ps, uint8_t gtag, unsigned unit,
                                      uint8_t secondary_pin, enum sim_level level);
/* First module with this tag, or NULL; advanced to the card's present clk. */
struct sim_module *sim_find(struct sim_card *card, uint8_t gtag);
/* The same, as far advanced as it is: for models that advance together. */
struct sim_module *sim_module_of(struct sim_card *card, uint8_t gtag);
/* The card's present clk (edges before it have been made). */
int64_t sim_now(const struct sim_card *card);
/* The watchdog bites now (called from its advance(), while it makes the edge at which the outputs go): every module's
 * bite() runs, and the pads are looked at again. next_event() must have announced that edge. */
void sim_bite(struct sim_card *card);
/* Some output of the module is watched or wired: from now on its next_event() matters. A model whose events act on
 * other modules (watchdog) asks for it in init(). */
void sim_watch_module(struct sim_module *m);
/* A port register has another value than before: the pads are looked at again. Called by the IOPort model. */
void sim_pads_changed(struct sim_card *card);
/* The pad behind which an output is, SIM_NO_PAD when there is none. */
#define SIM_NO_PAD UINT_MAX
unsigned sim_pad_of(const struct hm2_idrom *idrom, uint8_t gtag, unsigned unit, uint8_t secondary_pin);
/* Level of the secondary output behind a pad (SIM_LOW when it has none, or no model). */
enum sim_level sim_alternate(struct sim_card *card, unsigned io);
/* The secondary output behind a pad reaches it: the port registers say so. */
bool sim_pad_carries_alternate(struct sim_card *card, unsigned io);
/* Level of a pad: driven by the FPGA, else by the world outside; SIM_FLOAT when nobody drives or pulls it. */
enum sim_level sim_pad_level(struct sim_card *card, unsigned io);
/* The same for a pad that the FPGA does not drive, for the IOPort model, which knows that. */
enum sim_level sim_pad_outside(const struct sim_card *card, unsigned io);

/* DPLL timers seen by other modules (0 = reference, 1..4): the last rising edge before clk and the first one at or
 * after clk; SIM_NEVER (or INT64_MIN) when there is none. Answered by the HM2DPLL model. */
int64_t sim_dpll_last_rise(struct sim_card *card, unsigned timer, int64_t clk);
int64_t sim_dpll_next_rise(struct sim_card *card, unsigned timer, int64_t clk);

/* Position of a step generator at the module's present clk, 48.. bits: steps * 2^32. */
int64_t sim_stepgen_position(struct sim_card *card, unsigned stepgen);
/* Likewise that of a motor which makes its steps (for followers). It rests while the generator's first output does not
 * reach its pad; the whole steps that the generator makes meanwhile are left out. */
int64_t sim_stepgen_motor(struct sim_card *card, unsigned stepgen);
/* Likewise how far a motor has turned by a PWM generator's signed duty, while it was enabled and, as far as the looks
 * at this position can tell, drove its pin: seconds at full duty * 2^32. */
int64_t sim_pwmgen_position(struct sim_card *card, unsigned pwmgen);

/* Puts a waveform generator into the middle of its pulses: value in all of its table, the part of a pulse that it has
 * collected, in 1/4096, and edges of ClockHigh up to its next step. For recordings that begin there. */
void sim_wavegen_start(struct sim_card *card, unsigned wavegen, uint16_t value, uint16_t density, uint8_t edges);

#endif
