/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A card that is nothing but registers behind LBP16, on a mock link, for tests of the driver's book-keeping: what is
 * written can be read back, scratch registers are forgotten at a power cycle, and single datagrams can be lost,
 * delayed, repeated or damaged. Real register behaviour is the simulated card's business (lib/sim).
 */
#ifndef FAKE_CARD_H
#define FAKE_CARD_H

#include <stdbool.h>
#include <stdint.h>

#include <hm2/idrom.h>
#include <hm2/link.h>

#define FAKE_REPLY_NS 50000 /* from the request to its reply */

struct fake_card {
    char name[16];
    struct hm2_image image;
    uint32_t registers[0x4000]; /* HostMot2 space, one word each 4 bytes; the image is laid over it */
    uint16_t scratch[8];        /* space 4, 0x0010 on */
    uint16_t received;          /* space 6, 0x0008 and 0x000A */
    bool dead;                  /* hears and says nothing */

    /* For the next datagram of each kind; cleared when they have acted. */
    bool lose_request, lose_write, lose_reply, duplicate;
    bool refuse_send; /* send() itself fails */
    int cut;          /* shorten the next reply by so many bytes; negative = lengthen */
    int64_t delay_ns; /* of the next reply, on top */

    unsigned datagrams, requests, writes; /* seen, lost ones included */
    uint16_t written[64];                 /* addresses of register writes in the last datagram, in order */
    unsigned written_count;
};

/* The card of this image, reachable through *link (a mock). The card must outlive the link. */
void fake_card_open(struct fake_card *card, const char *name, const struct hm2_image *image, struct link **link);
/* Registers and scratch as after configuration; the image as it is now. */
void fake_card_power_cycle(struct fake_card *card);

#endif
