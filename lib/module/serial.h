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
void ring_drop(struct ring *ring, size_t len);

/* Lengths of the frames in a ring of bytes, oldest first. The bytes are there before the length, and taken before it is
 * dropped. */
#define FRAME_PLACES 256u
#define FRAME_SPOILT 0x8000u /* besides the length: not what was sent */

struct frame_ring {
    atomic_uint head, tail;
    uint16_t frame[FRAME_PLACES];
};

static inline unsigned frames_used(const struct frame_ring *const ring)
{
    return atomic_load_explicit(&ring->head, memory_order_acquire) -
           atomic_load_explicit(&ring->tail, memory_order_acquire);
}

/* There must be a place. */
void frames_put(struct frame_ring *ring, unsigned frame);
/* 0 when there is none. */
unsigned frames_oldest(const struct frame_ring *ring);
void frames_drop(struct frame_ring *ring);

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

/* What a reply tells of the datagrams between it and the good one before: that one's request, and all that were sent
 * after it. */
struct serial_passage {
    bool told; /* there is something else here than nothing */
    /* So many more have come than were sent: some came twice, or somebody else talks to the card. */
    unsigned twice;        /* requests, and turns */
    unsigned writes_twice; /* plain ones */
    bool stray; /* a request was carried out that nobody counts on: what FIFOs show now may not be what was expected */
    bool unheard; /* requests without a reply have not come */
};

enum { SERIAL_DATA, SERIAL_COUNT, SERIAL_RATE, SERIAL_MODE, SERIAL_REGISTERS };

#define SERIAL_COUNTS (sizeof(struct hm2_serial_counts) / sizeof(uint32_t))

struct hm2_serial {
    const struct serial_ops *ops;
    struct hm2_plan *plan;
    double clock_hz;
    uint16_t tx_reg[SERIAL_REGISTERS], rx_reg[SERIAL_REGISTERS];
    bool open;
    bool awaiting;                 /* a write and a request with our words are on their way */
    bool resend;                   /* the last write was lost: the same again */
    bool held;                     /* a turn had no reply: whether sent_bytes arrived is told by the next one */
    unsigned sent_bytes;           /* in the last write, until it is known to have arrived */
    unsigned turned_bytes;         /* in the turn that was answered last */
    bool stray;                    /* since the last good reply */
    struct serial_passage passage; /* take: up to this reply */
    int64_t sent_ns, now_ns;       /* take: of the request, and of its reply; late and ask: now */
    struct hm2_serial_settings settings;
    struct ring tx, rx;
    struct frame_ring tx_frames, rx_frames; /* when the settings say frames */
    uint32_t told_lost;                     /* the sum of losses at the last hm2_serial_lost() */
    struct hm2_serial_counts counts;        /* the cycle's own */
    _Atomic uint32_t shown[SERIAL_COUNTS];  /* the same, for the other thread */
};

/* In the order of a cycle; all but the first two are called for open ports only. */
struct serial_ops {
    int (*open)(struct hm2_serial *port, struct hm2_diag *diag);
    int (*set)(struct hm2_serial *port, const struct hm2_serial_settings *settings, struct hm2_diag *diag);
    void (*take)(struct hm2_serial *port); /* a fresh reply; what was sent is counted already */
    /* One that was given up, or a second one. False when it took something that nobody counts on. */
    bool (*late)(struct hm2_serial *port, uint64_t request);
    /* No fresh reply since the last write. With hold its bytes, if it may, stay as they are until the next reply tells
     * whether they arrived: true. */
    bool (*miss)(struct hm2_serial *port, bool hold);
    void (*send)(struct hm2_serial *port);                /* the next write, unless the last is sent again */
    void (*aim)(struct hm2_serial *port, unsigned bytes); /* so many of the bytes in the write go to the FIFO */
    void (*ask)(struct hm2_serial *port);                 /* the next request */
};

/* Checks what both kinds have in common. */
int serial_check(const struct hm2_serial *port, const struct hm2_serial_settings *settings, struct hm2_diag *diag);
uint32_t serial_rate(const struct hm2_serial *port, uint32_t baud, unsigned bits);

/* ---- the ports of a module ------------------------------------------------------------------------------------------
 */

struct serial_kind {
    const char *title;
    uint8_t rx_gtag;
    size_t size;          /* of a port of this kind, which begins with its struct hm2_serial */
    unsigned unit_stride; /* bytes between units; 0 = what the descriptor says */
    const struct serial_ops *ops;
};

/* Allocate the ports, with the receiver of each transmitter's number, and claim their pins. */
int serial_setup(struct hm2_module *module, struct hm2_setup *setup, const struct serial_kind *kind);
/* The receiver belongs to the transmitter of its number, which sets both up. */
int serial_setup_receiver(struct hm2_module *module, struct hm2_setup *setup);
/* Of the transmitter's pins (hal-interface 2.3, as LinuxCNC 2.9.x has it); an enable that is low while it sends has
 * none.
 */
const char *serial_output_name(const struct hm2_pd *pd);
/* NULL when there is none. */
struct hm2_serial *serial_port(const struct hm2_module *module, unsigned unit);

/* All that wait, and what else is in the rings. */
void serial_drop_frames(struct hm2_serial *port);

void serial_start(struct hm2_module *module, const struct hm2_cycle *cycle);
void serial_unpack(struct hm2_module *module, const struct hm2_cycle *cycle);
void serial_pack(struct hm2_module *module, const struct hm2_cycle *cycle);
void serial_write_lost(struct hm2_module *module);
void serial_late(struct hm2_module *module, uint64_t request, int64_t now_ns);

#endif
