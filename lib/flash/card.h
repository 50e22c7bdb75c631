/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Inside of struct flash_card, and the three things one does to a flash. */
#ifndef FLASH_CARD_H
#define FLASH_CARD_H

#include "image.h"
#include "port.h"

/* Most data that a reply carries beside the trailer: "about 1450 bytes" (seed 000, "SPACE 3"). */
#define FLASH_READ_MOST  1424u
#define FLASH_READ_LEAST 256u
#define FLASH_PAGES_MOST 5u
#define FLASH_AHEAD_MOST 4u /* requests to read that are on their way at once: flash tool reference 4.4 */
#define FLASH_BATCH_READ (FLASH_BATCH_MOST * FLASH_READ_MOST)

struct flash_card {
    struct flash_port port;
    struct flash_card_info info;
    struct flash_range writable; /* what the present job may change; empty = nothing */
    int64_t quiet_until_ns;      /* nobody else talked to the card a moment ago, which is believed until then */
    uint64_t quiet_foreign, quiet_intruders; /* ... unless these counters have moved */
};

/* "the card at ... was lost" with what to do next; returns err. */
int flash_lost(struct hm2_diag *diag, int err, const char *what);

/* Read everything that struct flash_card_info holds. */
int HM2_MUST_CHECK flash_identify(struct flash_card *card, struct hm2_diag *diag);

/* Erase one sector of the writable range; one datagram carries enable, address, erase and the echo (H1). */
int HM2_MUST_CHECK flash_erase(struct flash_card *card, uint32_t address, struct hm2_diag *diag);
/* Program pages of the writable range, from page-aligned address on, and read them back in the same datagram. Pages of
 * which every byte is FF are only read. `back` gets the bytes as they are now, or may be NULL. */
int HM2_MUST_CHECK flash_program(struct flash_card *card, uint32_t address, const uint8_t *bytes, unsigned pages,
                                 uint8_t *back, struct hm2_diag *diag);
/* One datagram's worth of reading; *count is cut to what came. */
int HM2_MUST_CHECK flash_read_some(struct flash_card *card, uint32_t address, uint8_t *bytes, size_t *count,
                                   struct hm2_diag *diag);

/* The same with several datagrams at once, as long as none is lost: then one at a time for ever after. */
int HM2_MUST_CHECK flash_read_ahead(struct flash_card *card, uint32_t address, uint8_t *bytes, size_t *count,
                                    struct hm2_diag *diag);

#endif
