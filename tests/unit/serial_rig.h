/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A serial port of a simulated card, in virtual time. */
#ifndef SERIAL_RIG_H
#define SERIAL_RIG_H

#include <hm2/serial.h>

#include "sim_bench.h"

/* Open port 0 and set it. Fails the test when something does not work. */
struct hm2_serial *serial_rig_open(struct sim_bench *bench, enum hm2_serial_kind kind,
                                   const struct hm2_serial_settings *settings);
/* A started board that will pipeline its cycles. The recorded firmware with serial ports has no DPLL: it gets the
 * 7I96S's. */
struct sim_bench *serial_rig_pipelined(const char *firmware);
/* Cycles until turns begin; within so many, or the test fails. */
#define SERIAL_RIG_TO_TURNS 600u
void serial_rig_start_turns(struct sim_bench *bench);
/* The world outside sends back what it hears from port 0 of the module; it lasts as long as the bench. */
void serial_rig_echo(struct sim_bench *bench, uint8_t gtag);

/* The world outside: what it heard, and what it says to port 0 of the packet UARTs. */
struct serial_ear {
    size_t heard;
    uint8_t byte[4096]; /* the first that were heard */
};
void serial_rig_listen(struct sim_bench *bench, struct serial_ear *ear);
void serial_rig_say(struct sim_bench *bench, const void *bytes, size_t len);

#endif
