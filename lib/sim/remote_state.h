/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the files of a remote share: its state, and looking at its fields. */
#ifndef SIM_REMOTE_STATE_H
#define SIM_REMOTE_STATE_H

#include "remote_kind.h"

#define REMOTE_MAX_FIELDS  32u
#define REMOTE_FLASH_BYTES 0x8000u
#define REMOTE_PAGE_LOG2   6u
#define REMOTE_BLOCK_LOG2  9u

/* What reads and writes mean (LBP EC). */
enum { REMOTE_WORKING, REMOTE_EEPROM, REMOTE_FLASH };

struct remote_flash {
    uint8_t bytes[REMOTE_FLASH_BYTES], page[1u << REMOTE_PAGE_LOG2];
    uint32_t offset;
};

struct remote {
    const struct remote_kind *kind;
    uint8_t memory[REMOTE_MEMORY];
    uint8_t nv[REMOTE_NV_BYTES];
    struct remote_flash flash; /* lives on when the power is off */
    uint8_t nv_memory;         /* that reads and writes mean */
    uint8_t mode, baud;
    bool setup;                        /* the jumper */
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

/* remote_flash.c. False: nothing is written. */
bool remote_flash_write(struct remote_flash *flash, uint16_t address, uint8_t value);
uint8_t remote_flash_read(const struct remote_flash *flash, uint16_t address);

/* remote.c */
void remote_add_fault(struct remote *remote, uint8_t fault);

#endif
