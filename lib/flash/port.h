/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Exchanges with a card of which every reply is known to belong to its request (flash tool reference 4.5): each
 * datagram writes a new number to the scratch register of space 6 and reads it back last. The card's packet counter
 * comes along and tells whether others talk to it.
 */
#ifndef FLASH_PORT_H
#define FLASH_PORT_H

#include <hm2/flash.h>

/* What the reply has beside the data: scratch register before, status words, scratch register after. */
#define FLASH_TRAILER_BYTES 16u

enum flash_work { FLASH_WORK_READ, FLASH_WORK_PROGRAM, FLASH_WORK_ERASE, FLASH_WORKS };

struct flash_port {
    struct link *link;
    uint16_t sequence, accepted;   /* of the newest request, and of the last one that was answered */
    bool greeted;                  /* something was answered: rx_udp is valid */
    uint16_t rx_udp;               /* the card's counter of datagrams with the last reply */
    unsigned unaccounted;          /* sent since */
    int64_t behind;                /* sent and, as far as the counter tells, not come to the card */
    uint64_t intruders;            /* replies before which somebody else had written the scratch register */
    int64_t worst_ns[FLASH_WORKS]; /* recent answers; 0 = none yet */
    struct flash_counters counters;

    struct lbp16_builder builder;
    size_t before_at, status_at, echo_at;
    uint8_t request[LBP16_MAX_REQUEST_BYTES];
    uint8_t reply[LBP16_MAX_REPLY_BYTES];
};

void flash_port_init(struct flash_port *port, struct link *link);
/* Begin a request; then add commands to port->builder; then run it: send, wait, resend the identical datagram. The
 * work decides how long and how often. 0: port->reply holds the answer. HM2_ERR_TIMEOUT after the last try. */
void flash_port_begin(struct flash_port *port);
int HM2_MUST_CHECK flash_port_run(struct flash_port *port, enum flash_work work, unsigned tries);
/*
 * Several requests on their way at once, for reading only: nothing is sent twice, and whatever is missing in the end
 * the caller asks for again, one request at a time. Begin; then for each request flash_port_begin(), commands, and
 * send; take answers in between; end.
 */
#define FLASH_BATCH_MOST 16u
struct flash_batch {
    uint16_t first; /* sequence number */
    unsigned sent, answered;
    uint16_t come; /* the most datagrams that an answer says have come to the card since the batch began */
    struct {
        size_t reply_bytes;
        bool answered;
    } part[FLASH_BATCH_MOST];
};
void flash_batch_begin(const struct flash_port *port, struct flash_batch *batch);
int HM2_MUST_CHECK flash_batch_send(struct flash_port *port, struct flash_batch *batch);
/* Number of the request that port->reply answers; HM2_ERR_TIMEOUT when none comes. */
int HM2_MUST_CHECK flash_batch_receive(struct flash_port *port, struct flash_batch *batch);
void flash_batch_end(struct flash_port *port, const struct flash_batch *batch);
/* Send without waiting: for what is never answered. */
int HM2_MUST_CHECK flash_port_fire(struct flash_port *port);
/* Let time pass; what arrives meanwhile is late and dropped. */
void flash_port_wait(struct flash_port *port, int64_t ns);
#define FLASH_TRIES 8u

#endif
