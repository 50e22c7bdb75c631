/* SPDX-License-Identifier: GPL-2.0-or-later */
/* What happens in a run, cycle by cycle: to the driver's pins, to the card's pads, to the network. */
#ifndef TEST_DROPIN_SCENARIO_H
#define TEST_DROPIN_SCENARIO_H

#include <stddef.h>
#include <stdint.h>

#include <hm2/sim.h>

#include "driver.h"

/* A point gets a value in one cycle, before read(). */
struct setting {
    unsigned cycle;
    const char *point;
    double value;
};

/* A point gets a value in every cycle of [from, to), before write(): offset + amplitude * shape(place in the period).
 */
struct wave {
    const char *point;
    enum { WAVE_SINE, WAVE_TRIANGLE, WAVE_SQUARE, WAVE_TRAPEZOID, WAVE_RAMP } shape;
    double amplitude, offset;
    unsigned period, from, to;
};

enum action {
    FOLLOW, /* encoder a turns with step generator b, c counts in d steps */
    INDEX,  /* index input of encoder a is at level b */
    PAD,    /* the world outside drives I/O a to level b */
    TURN,   /* in each cycle of [cycle, to): encoder a makes b edges (its inputs are driven) */
    /* Resolver a stands at b thousandths of a turn, with c thousandths of the amplitude; PWM generator a turns it,
     * d thousandths of a turn a second at full duty. */
    RESOLVER,
    LOSE_REQUESTS, /* in [cycle, to) */
    LOSE_WRITES,   /* in [cycle, to) */
    NO_WRITE,      /* write() is not called in [cycle, to) */
    SERVO_VOLTS,   /* b millivolts at analog input a of the 7I65 */
    SERVO_INPUTS,  /* levels of the 7I65's digital inputs: a */
    ABSOLUTE, /* in [cycle, to): an absolute encoder of c bits, turning d counts a cycle, at channel b of module a */
    ABSOLUTE_GRAY, /* the same in Gray code */
    INPUT,         /* input pin c of instance b of module a is at level d */
    POWER_CYCLE,   /* of the card, in this cycle */
    REMOTE,        /* field b (enum remote_field) of the remote at channel a gets c thousandths */
};

struct event {
    unsigned cycle, to;
    enum action action;
    int a, b, c, d;
};

enum remote_field { REMOTE_INPUT, REMOTE_ANALOG_IN_0, REMOTE_ANALOG_IN_3, REMOTE_ENCODER_0 };

/* A value that a point must have reached at least in some cycle, or the script does not test what it says. */
struct milestone {
    const char *point;
    double value;
};

#define MAX_MILESTONES 4u

struct scenario {
    const char *name, *card, *config;
    unsigned cycles;
    const struct setting *settings;
    const struct wave *waves;
    const struct event *events;
    size_t setting_count, wave_count, event_count;
    /* Not 0: so often, all points get values of their own, but those that `keeps` names; what both drivers make of them
     * is compared in the last cycle before the next values only. */
    unsigned settle;
    const char *const *keeps;                 /* shell patterns, ends with NULL */
    bool paced;                               /* the card's processor takes its time */
    const char *firmware;                     /* of the card instead of the usual one, or NULL */
    enum sim_sources sources;                 /* that the card's firmware is made from */
    const char *remote;                       /* see struct driver */
    unsigned from;                            /* nothing is compared before this cycle */
    bool has_7i65;                            /* at the card's first buffered SPI port */
    struct milestone reached[MAX_MILESTONES]; /* ends with a point NULL, or when full */
};

extern const struct scenario scenarios[];
extern const size_t scenario_count;

/* Whether what happened up to this cycle is compared after it. */
bool scenario_compares(const struct scenario *scenario, unsigned cycle);
/* One cycle with all that belongs to it: read, then write. */
void scenario_cycle(const struct scenario *scenario, struct driver *driver);

#endif
