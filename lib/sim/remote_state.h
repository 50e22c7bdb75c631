/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the files of a remote share: its state, and looking at its fields. */
#ifndef SIM_REMOTE_STATE_H
#define SIM_REMOTE_STATE_H

#include "remote_kind.h"

#define REMOTE_MAX_FIELDS 32u

struct remote {
    const struct remote_kind *kind;
    uint8_t memory[REMOTE_MEMORY];
    uint8_t nv[REMOTE_NV_BYTES];
    uint8_t nv_memory; /* that reads and writes mean; 0 = none */
    uint8_t mode, baud;
    uint8_t held;                      /* faults of causes that last */
    uint64_t world[REMOTE_MAX_FIELDS]; /* what is outside of each input field */
    uint32_t shorted, tripped;         /* outputs */
    int64_t fed_ns;
};

static inline unsigned remote_bytes_of(const unsigned bits)
{
    return (bits + 7) / 8;
}

static inline uint64_t remote_mask_of(const unsigned bits)
{
    return bits < 64 ? (1ULL << bits) - 1 : UINT64_MAX;
}

/* remote_tables.c: memory, fields and tables of contents. */
void remote_store(uint8_t *memory, unsigned address, uint64_t value, unsigned bytes);
uint64_t remote_load(const uint8_t *memory, unsigned address, unsigned bytes);
/* The kind's own fields, then the parameters that all share; NULL behind the last. */
const struct remote_field *remote_field_at(const struct remote_kind *kind, unsigned index);
const struct remote_field *remote_find_field(const struct remote_kind *kind, const char *name, unsigned *index);
bool remote_to_host(const struct remote_field *field);
bool remote_from_host(const struct remote_field *field);
void remote_put_tables(struct remote *remote);

/* remote_world.c: what an output field does, raw; inputs as they are now; shorted outputs trip when they come on. */
uint64_t remote_applied(const struct remote *remote, const struct remote_field *field);
void remote_sample(struct remote *remote);
void remote_look_for_shorts(struct remote *remote);

/* remote.c */
void remote_add_fault(struct remote *remote, uint8_t fault);

#endif
