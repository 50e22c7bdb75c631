/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The transactions of a map on their links: one thread of normal priority a link, which waits for devices so that no
 * cycle has to. The functions for the cycle take no lock, allocate nothing and make no system call.
 */
#ifndef MODBUS_IO_ENGINE_H
#define MODBUS_IO_ENGINE_H

#include <hm2/modbus.h>

struct engine;

/* What is known of a transaction after a try. */
struct engine_state {
    bool good;      /* the last try was good */
    bool connected; /* the device answered, be it with an exception */
    uint32_t goods, errors, errors_in_row;
};

struct engine_result {
    struct engine_state state;
    uint16_t words[]; /* of the last good answer to a read; coils are 0 or 1 each */
};

/* The map must stay until engine_free(). NULL when there is no memory. */
struct engine *engine_new(const struct hm2_modbus_map *map);
/* 0 or a negative errno. */
int engine_start(struct engine *engine);
/* Ends the threads, each after the time-out that it may be in, and frees all. NULL is nothing. */
void engine_free(struct engine *engine);

/* ---- of the cycle: one thread ---- */

/* Words for the device, to be filled whole and sent; nothing is written to a device before that. */
uint16_t *engine_order(struct engine *engine, unsigned transaction);
void engine_send(struct engine *engine, unsigned transaction);
void engine_enable(struct engine *engine, unsigned transaction, bool enable);
/* The newest result; *fresh tells whether there was a try since the last call. */
const struct engine_result *engine_result(struct engine *engine, unsigned transaction, bool *fresh);

#endif
