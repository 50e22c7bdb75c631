/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What a HostMot2 module driver is: one file in lib/module, one row in the registry.
 *
 * A module type checks its descriptor, claims its pins, binds its points and adds its registers to the transfer plan
 * in setup(); afterwards unpack() turns received registers into pin values and pack() turns pin values into
 * registers. unpack() and pack() are realtime safe: no allocation, lock, formatting or system call; they never divide
 * by a pin without a guard and never let a NaN or an out-of-range value reach a register.
 */
#ifndef HM2_MODULE_H
#define HM2_MODULE_H

#include <limits.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/config.h>
#include <hm2/err.h>
#include <hm2/idrom.h>
#include <hm2/number.h>
#include <hm2/plan.h>
#include <hm2/points.h>

/* Facts of the present cycle, the same for every module of a card. */
struct hm2_cycle {
    int64_t now_ns;      /* link's clock, when the inputs were asked for (unpack) or the write is packed (pack) */
    int64_t received_ns; /* unpack: when the reply was here */
    int64_t period_ns;   /* of the thread, > 0 */
    double period_s;
    double age_s;     /* unpack: what the inputs are older than this cycle; 0 unless pipelined */
    bool turned;      /* the last write was a turn (hm2_plan_turn()): its reply was read soon after the write */
    bool before_kept; /* unpack: as in struct hm2_plan_facts */
    uint32_t writes;  /* write cycles since load or since the last restart; 0 = this is the first */
    bool bitten;      /* the card's watchdog has bitten and was not yet cleared: outputs are off */
    double undriven;  /* unpack: part (0..1) of the time since the last one in which outputs were off after a bite */
};

/* Conditions a module meets in a cycle that a person should hear about. The board turns them into messages outside
 * the realtime path (or through the host's queued print), each at most once until it ends. */
enum hm2_notice {
    HM2_NOTICE_WATCHDOG_BIT,  /* a: 0 */
    HM2_NOTICE_VALUE_CLAMPED, /* a point was out of range and was rewritten */
    HM2_NOTICE_VALUE_INVALID, /* a point was NaN or impossible; a safe value is used */
    HM2_NOTICE_QUAD_ERROR,
    HM2_NOTICE_TIMEOUT_SHORT,      /* watchdog time-out below 1.5 periods */
    HM2_NOTICE_TABLE_TOO_LONG,     /* step table longer than 16 or wider than the pins */
    HM2_NOTICE_HEADROOM,           /* command needs more than maxvel/maxaccel allow */
    HM2_NOTICE_DUMP_STATE,         /* a person asked for a listing of all modules (raw.dump_state) */
    HM2_NOTICE_REMOTE_LOST,        /* smart serial; value: channel. Too many failures, the remote is stopped */
    HM2_NOTICE_REMOTE_NOT_STARTED, /* START failed on it */
    HM2_NOTICE_REMOTE_OTHER,       /* another remote answers than at load */
    HM2_NOTICE_REMOTE_BACK,        /* it answers again and is driven again */
    HM2_NOTICE_REMOTE_FAULT,       /* it reports faults; value: the fault byte */
    HM2_NOTICE_PORT_STOPPED,       /* the whole port */
    HM2_NOTICE_PORT_LATE,          /* a transfer was not finished when the next cycle came */
    HM2_NOTICE_PARAMETER_REFUSED,  /* value: channel */
    HM2_NOTICES
};

struct hm2_board;
struct hm2_module;

/* Owner of an I/O pin, one per pin descriptor. */
struct hm2_pin {
    struct hm2_pd pd;
    const struct hm2_module *owner; /* NULL = GPIO */
    bool immediate;                 /* owner's output is driven from load on, not from the first write on */
};

struct hm2_setup {
    const struct hm2_idrom *idrom;
    const struct hm2_config *config;
    struct hm2_plan *plan;
    struct hm2_binder *binder;
    struct hm2_pin *pins; /* idrom->pin_count */
    struct hm2_diag *diag;
    const char *prefix;  /* "hm2_7i96s.0" */
    unsigned board_leds; /* from the board table */
    bool has_dpll;       /* the firmware contains an HM2DPLL, whether used or not */
    void *access;        /* for peek and poke */
    /* One confirmed register access at load time. 0 or the link's error. Undriven registers read 0 or all ones. */
    int (*peek)(struct hm2_setup *setup, uint16_t address, unsigned words, uint32_t *values);
    int (*poke)(struct hm2_setup *setup, uint16_t address, unsigned words, const uint32_t *values);
    int64_t (*now_ns)(const struct hm2_setup *setup); /* the link's clock, for limits of waiting */
};

/* Accepted descriptor (hal-interface 1.5). */
struct hm2_md_variant {
    uint8_t version, registers;
    uint32_t instance_stride, multiple;
};

struct hm2_module_type {
    const char *name; /* HAL name part: "stepgen" */
    uint8_t gtag;
    const struct hm2_md_variant *variants;
    size_t variant_count; /* 0 = any */
    int config_count;     /* enum hm2_config_count or -1 when the number cannot be configured */
    bool clamp_count;     /* a configured number above the firmware's is clamped with a warning */
    /* Claim pins, bind points, add registers; sets module->context (memory from the binder). module->instances is
     * already the number to use; 0 = present but not used (setup is called all the same). A board calls unpack() and
     * pack() only of modules that have a context. */
    int (*setup)(struct hm2_module *module, struct hm2_setup *setup);
    /* The first reply after load, or after the card came back from a power cycle, is in the windows: take present
     * counter values as the start, so that positions neither jump nor lose what they had. May be NULL. */
    void (*start)(struct hm2_module *module, const struct hm2_cycle *cycle);
    void (*unpack)(struct hm2_module *module, const struct hm2_cycle *cycle); /* may be NULL */
    void (*pack)(struct hm2_module *module, const struct hm2_cycle *cycle);   /* may be NULL */
    /* After the reply was judged fresh but before unpack, a write had been lost: modules with self-clearing bits
     * learn here that what they sent did not arrive. Most need nothing (sections are resent). May be NULL. */
    void (*write_lost)(struct hm2_module *module);
    /* A reply to the request of this number (hm2_plan_requests()) has come after it was given up, or a second one that
     * tells that the card carried it out twice, now; while this runs, the windows show it. For FIFOs, whose words come
     * only once: anything else in it is out of date. May be NULL. */
    void (*late)(struct hm2_module *module, uint64_t request, int64_t now_ns);
    /* For pipelined cycles: how long after a write what it has started can be read, and whether the last reply to a
     * turn came too early for it all the same. Both NULL = a write starts nothing that takes time. Realtime safe. */
    int64_t (*turn_ns)(const struct hm2_module *module);
    bool (*unfinished)(const struct hm2_module *module);
    /* HAL name of an output pin of this module ("step"), from which a port makes the second names of the pin's
     * parameters ("stepgen.00.step.invert_output", hal-interface 2.3). NULL for a pin that has no such name, e.g. an
     * input; the function itself may be NULL when no pin has one. */
    const char *(*output_name)(const struct hm2_pd *pd);
    const char *output_stem; /* first part of those names; NULL = name */
    /* Tables of the points, for documentation and tests; the list ends with a row whose prefix is NULL. */
    const struct hm2_point_group *groups;
};

/* A documented table of points: prefix "stepgen.##" means one set per instance. */
struct hm2_point_group {
    const char *prefix;
    const struct hm2_point *points;
    size_t count;
    const char *condition; /* when these exist, NULL = always */
};

struct hm2_module {
    const struct hm2_module_type *type;
    const struct hm2_md *md;
    struct hm2_board *board; /* for hm2_notice() */
    unsigned instances;      /* in use */
    void *context;
    const char *prefix; /* of the board */
    uint32_t *noticed;  /* HM2_NOTICES counters of what hm2_notice() was told, or NULL */
};

/* Report a condition from a cycle, in every cycle in which it holds: counts it, and hands it to the board's message
 * queue when it is new (again after it has been absent for about a second). instance and value go into the message.
 * Without a board only the counters move, so a module can be tested alone. Realtime safe. */
HM2_API void hm2_notice(const struct hm2_module *module, enum hm2_notice notice, unsigned instance, double value);
/* The same about one point, named as it is below its instance ("scan_rate", a constant); each point of an instance is
 * told for itself. HM2_NO_INSTANCE: a point of the module. */
#define HM2_NO_INSTANCE UINT_MAX
HM2_API void hm2_notice_point(const struct hm2_module *module, enum hm2_notice notice, const char *point,
                              unsigned instance, double value);

/* Claim every pin whose secondary tag is gtag (HM2_GTAG_NONE: the module's own) and whose unit is below units; global
 * pins are claimed when units > 0. filter may be NULL; it may refuse single pins. Already claimed pins are a violation:
 * each is reported in diag, and HM2_ERR_MISMATCH is returned. */
HM2_API int HM2_MUST_CHECK hm2_claim_pins(const struct hm2_module *module, struct hm2_setup *setup, uint8_t gtag,
                                          unsigned units, bool immediate,
                                          bool (*filter)(const struct hm2_pd *pd, const struct hm2_setup *setup));
/* The same for one pin. */
HM2_API int HM2_MUST_CHECK hm2_claim_pin(const struct hm2_module *module, const struct hm2_setup *setup, unsigned io,
                                         bool immediate);

/* Every module type this library knows, in the order in which a board sets them up, unpacks and packs them. Ports come
 * behind all types that claim pins, because they offer as GPIO what nobody claimed. A type whose gtag is HM2_GTAG_NONE
 * has no descriptor: its setup is called once per board, with md NULL and instances 1. NULL-terminated. */
HM2_API extern const struct hm2_module_type *const hm2_module_types[];

#endif
