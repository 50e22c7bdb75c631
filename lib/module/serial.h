/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What UART and PktUART share: rings, queues of variable length in a list of fixed length, and the counts. */
#ifndef HM2_MODULE_SERIAL_H
#define HM2_MODULE_SERIAL_H

#include <stdatomic.h>

#include <hm2/serial.h>

#include "bind.h"

/* ---- a ring between two threads -----------------------------------------------------------------------------------
 */

#define RING_BYTES 8192u

struct ring {
    atomic_uint head, tail; /* of put and get; they run on */
    uint8_t byte[RING_BYTES];
};

static inline unsigned ring_used(const struct ring *const ring)
{
    return atomic_load_explicit(&ring->head, memory_order_acquire) -
           atomic_load_explicit(&ring->tail, memory_order_acquire);
}

size_t ring_put(struct ring *ring, const uint8_t *bytes, size_t len);
size_t ring_get(struct ring *ring, uint8_t *bytes, size_t size);

/* ---- 0 to 63 words of a FIFO: blocks of 1, 2, 4 ... words, each of which goes to the FIFO or nowhere ----------------
 */

#define QUEUE_BLOCKS 6u

struct queue {
    unsigned blocks;
    uint16_t fifo, nowhere;
    struct hm2_window block[QUEUE_BLOCKS];
};

int queue_add_reads(struct queue *queue, struct hm2_plan *plan, unsigned blocks, struct hm2_diag *diag);
int queue_add_writes(struct queue *queue, struct hm2_plan *plan, unsigned blocks, struct hm2_diag *diag);
/* Use so many words. */
void queue_aim(struct queue *queue, unsigned words);
/* Word n of those in use. */
struct queue_place {
    struct hm2_window *window;
    unsigned word;
};
struct queue_place queue_place(struct queue *queue, unsigned words, unsigned n);

/* ---- a port ---------------------------------------------------------------------------------------------------------
 */

struct hm2_serial {
    const struct serial_ops *ops;
    struct hm2_plan *plan;
    double clock_hz;
    bool open;
    struct hm2_serial_settings settings;
    struct ring tx, rx;
    struct hm2_serial_counts counts;
};

struct serial_ops {
    int (*open)(struct hm2_serial *port, struct hm2_diag *diag);
    int (*set)(struct hm2_serial *port, const struct hm2_serial_settings *settings, struct hm2_diag *diag);
};

/* Checks what both kinds have in common. */
int serial_check(const struct hm2_serial *port, const struct hm2_serial_settings *settings, struct hm2_diag *diag);
uint32_t serial_rate(const struct hm2_serial *port, uint32_t baud, unsigned bits);
struct hm2_serial *uart_port(const struct hm2_module *module, unsigned unit);
struct hm2_serial *pktuart_port(const struct hm2_module *module, unsigned unit);

#endif
