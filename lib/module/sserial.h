/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Smart serial: what the files of this module share. Private to lib/module. */
#ifndef HM2_MODULE_SSERIAL_H
#define HM2_MODULE_SSERIAL_H

#include <hm2/module.h>
#include <hm2/sslbp.h>

#include "levels.h"

#define SSERIAL_PORTS 8u

struct sserial_bit_out {
    hm2_bit_t *bit, *invert;
};

/* A field of process data with its points. Which members are used tells its type. */
struct sserial_field {
    uint8_t type, bits, direction;
    uint16_t in_at, out_at; /* first bit in the interface registers */
    union {
        struct {
            struct hm2_level *in;             /* [bits], or [1]; of inputs, and of fields for both directions */
            uint32_t turn;                    /* of inputs, see levels.h; 0 = every pin */
            uint32_t shown[SSLBP_USER_WORDS]; /* levels as the pins have them */
            struct sserial_bit_out *out;      /* of outputs */
        } bit;
        struct {
            hm2_float_t *value, *scalemax, *maxlim, *minlim;
        } number;
        struct {
            hm2_u32_t *value;
        } stream;
        struct {
            hm2_s32_t *count, *rawcounts;
            hm2_float_t *position, *scale;
            hm2_bit_t *index_enable, *reset;
            hm2_u32_t *counts_per_rev;
            int64_t accumulated, offset;
            uint64_t raw_before;
            uint8_t low_bits; /* of the ENCODER_L field in front, which lie at low_at */
            uint16_t low_at;
            bool known; /* raw_before holds a value */
        } counter;
    } as;
};

/* A global parameter. */
struct sserial_global {
    union {
        hm2_u32_t *u;
        hm2_s32_t *s;
        hm2_float_t *f;
    } value;
    uint64_t written; /* as it stands in the remote, as far as known */
    uint16_t address;
    uint8_t type, bits, bytes;
    bool writable, nonvolatile;
};

struct sserial_remote {
    unsigned channel;
    hm2_u32_t *status, *errors;
    hm2_bit_t *fault;
    unsigned field_count, global_count;
    struct sserial_field *fields;
    struct sserial_global *globals;
    unsigned in_words, out_words;
    uint32_t out[SSLBP_USER_WORDS]; /* as sent last */
    hm2_bit_t nothing;              /* target of pins that do not exist */
};

struct sserial_port {
    struct sserial_points {
        hm2_s32_t *debug;
        hm2_bit_t *run, *fault, *auto_restart;
        hm2_u32_t *port_state, *port_state2, *port_state3, *fault_count;
        hm2_u32_t *fault_inc, *fault_dec, *fault_lim;
        hm2_u32_t *skipped, *restarts;
        hm2_float_t *doit_us;
    } points;
    unsigned number;         /* of the hardware port */
    uint8_t first, channels; /* channels first .. first + channels - 1 are transferred */
    unsigned user_words;     /* interface registers read, and ... */
    unsigned write_words;    /* written */
    int64_t doit_ns;         /* that a DOIT takes, with a reserve */
    struct hm2_window command, data, cs, user[SSLBP_USER_WORDS];
    struct hm2_window command_out, cs_out, user_out[SSLBP_USER_WORDS];
    struct sslbp_engine engine;
    bool write_lost;                   /* told since the last reply */
    unsigned scan_remote, scan_global; /* parameter that is looked at next */
    struct sserial_global *writing;    /* its write is under way */
    uint64_t writing_value;
    unsigned remote_count;
    struct sserial_remote *remotes;
};

struct sserial {
    unsigned port_count;
    struct sserial_port *ports;
};

/* What was found behind one port at load. */
struct sserial_found {
    unsigned mask; /* channels with a remote */
    struct sslbp_identity identity[SSLBP_CHANNELS];
    char prefix[SSLBP_CHANNELS][HM2_NAME_SIZE]; /* of their points */
    struct sslbp_tables *tables[SSLBP_CHANNELS];
};

/* ---- sserial_find.c: at load, with the pins driven by the caller ------------------------------------------------ */

/* channels: those of the configuration that have pins. Tables are allocated here and freed by sserial_forget(). */
int HM2_MUST_CHECK sserial_find(const struct hm2_module *module, struct hm2_setup *setup, unsigned port,
                                unsigned channels, struct sslbp_port *access, struct sserial_found *found);
/* Mode that the configuration asks for; 0 where it says nothing. */
unsigned sserial_mode(const struct hm2_setup *setup, unsigned port, unsigned channel);
void sserial_forget(struct sserial_found *found);

/* ---- sserial_points.c ------------------------------------------------------------------------------------------- */

extern const struct hm2_point_group sserial_groups[];
int HM2_MUST_CHECK sserial_bind_port(const struct hm2_setup *setup, struct sserial_port *port);
/* Points of one remote; the values of its parameters are read from it (port in set-up mode). */
int HM2_MUST_CHECK sserial_bind_remote(const struct hm2_setup *setup, const struct sslbp_port *access,
                                       struct sserial_remote *remote, const char *prefix,
                                       const struct sslbp_tables *tables);

/* ---- sserial_fields.c: realtime --------------------------------------------------------------------------------- */

void sserial_unpack(struct sserial_remote *remote, const uint32_t *words);
void sserial_pack(const struct hm2_module *module, unsigned port, struct sserial_remote *remote);
/* The next value of every counter is its start. */
void sserial_start_counters(struct sserial_remote *remote);
/* The value of a parameter as the remote holds it. */
uint64_t sserial_global_raw(const struct sserial_global *global);
void sserial_global_show(const struct sserial_global *global, uint64_t raw);

/* ---- sserial_cycle.c -------------------------------------------------------------------------------------------- */

void sserial_restart(struct hm2_module *module, const struct hm2_cycle *cycle);
void sserial_unpack_all(struct hm2_module *module, const struct hm2_cycle *cycle);
void sserial_pack_all(struct hm2_module *module, const struct hm2_cycle *cycle);
void sserial_write_lost(struct hm2_module *module);
int64_t sserial_turn_ns(const struct hm2_module *module);
bool sserial_unfinished(const struct hm2_module *module);

#endif
