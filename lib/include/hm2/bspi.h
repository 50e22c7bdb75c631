/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Buffered SPI ports of a card (tag 0E), for those who know what is connected to them (register map 3.10,
 * hal-interface 2.20).
 *
 * Each channel of a port says how a word is sent. Frames are words that are sent in every cycle, in the order in which
 * they were added; what came back is there in the next cycle. The words travel in the fixed lists of the cycle: the
 * port's FIFOs are emptied, then filled, so that a lost packet cannot shift what belongs together.
 */
#ifndef HM2_BSPI_H
#define HM2_BSPI_H

#include <stdbool.h>
#include <stdint.h>

#include <hm2/board.h>

#define HM2_BSPI_CHANNELS 16u
#define HM2_BSPI_FRAMES   32u

struct hm2_bspi;

struct hm2_bspi_channel {
    unsigned chip_select; /* 0..15 */
    unsigned bits;        /* 1..32: the firmware sends no more (Annex D) */
    double mhz;           /* > 0; at most half of the module's clock is used */
    unsigned delay_ns; /* before and after the frame; 0 = none. As far as the 16 clocks reach that the port can wait */
    bool cpol, cpha;
    bool keep_frame;  /* chip select stays active after the word */
    bool no_echo;     /* nothing is received */
    bool sample_late; /* half a bit later */
};

/* Port `unit` of a card that is set up, or NULL when it has none or the configuration does not use it. */
HM2_API struct hm2_bspi *hm2_bspi_port(struct hm2_board *board, unsigned unit);

/* Settings of a channel. HM2_ERR_RANGE with the reason. Not in a cycle. */
HM2_API int HM2_MUST_CHECK hm2_bspi_set_channel(struct hm2_bspi *port, unsigned channel,
                                                const struct hm2_bspi_channel *settings, struct hm2_diag *diag);
/* The channel was set. */
HM2_API bool hm2_bspi_channel_known(const struct hm2_bspi *port, unsigned channel);
/* Add a frame on a channel that was set: *out is the word to send, *in (NULL for a channel without echo) the one that
 * came back, upper bits included as the firmware has them. The words live as long as the board. Between
 * hm2_board_change_begin() and hm2_board_change_end(). in may be NULL. */
HM2_API int HM2_MUST_CHECK hm2_bspi_add_frame(struct hm2_bspi *port, unsigned channel, uint32_t **out, uint32_t **in,
                                              struct hm2_diag *diag);
/* Send a word once, behind the frames of one of the next cycles: false when sixteen wait already. It is sent again when
 * its packet was lost, so the far end may see it twice. Realtime safe, one caller at a time. */
HM2_API bool hm2_bspi_send(struct hm2_bspi *port, unsigned channel, uint32_t word);

/* Called in every cycle with a fresh reply, after the frames' words were taken, and before the next words are packed.
 * Realtime code of the caller's; NULL = nothing. */
typedef int (*hm2_bspi_fn)(void *context);
HM2_API void hm2_bspi_on_read(struct hm2_bspi *port, hm2_bspi_fn function, void *context);
HM2_API void hm2_bspi_on_write(struct hm2_bspi *port, hm2_bspi_fn function, void *context);
/* Cycles in which fewer words had come back than frames with echo were sent; their words stayed what they were. */
HM2_API uint32_t hm2_bspi_short_cycles(const struct hm2_bspi *port);

#endif
