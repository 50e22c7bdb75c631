/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Serial ports of a card: UART (tags 09, 0A) and PktUART (1B, 1C; register map 3.12, 3.13 and Annex D), as streams of
 * bytes.
 *
 * A PktUART can carry frames instead of a stream: what is put as one is sent without a pause, and what was received
 * between two pauses is given whole, or not at all.
 *
 * A port that is open takes part in every cycle, within lists of fixed length: nothing is read or written besides.
 * Bytes wait in rings between the cycle and one other thread, which puts and gets without a lock. Nothing is lost in
 * silence: a full ring takes no more, and what the firmware or a lost packet lost is counted.
 */
#ifndef HM2_SERIAL_H
#define HM2_SERIAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/board.h>

struct hm2_serial;

enum hm2_serial_kind { HM2_SERIAL_UART, HM2_SERIAL_PKTUART };
enum hm2_parity { HM2_PARITY_NONE, HM2_PARITY_EVEN, HM2_PARITY_ODD };
enum hm2_serial_drive { HM2_DRIVE_AUTO, HM2_DRIVE_ON, HM2_DRIVE_OFF };

struct hm2_serial_settings {
    uint32_t baud;                     /* > 0, at most a quarter of the module's clock */
    enum hm2_parity parity;            /* PktUART with version 1 or later only */
    enum hm2_serial_drive drive;       /* AUTO: the transmitter is enabled while it sends */
    bool mask;                         /* the receiver ignores what the own transmitter sends */
    bool deaf;                         /* PktUART: the receiver is off */
    bool frames;                       /* PktUART: hm2_serial_put_frame() and its like, not _put() and _get() */
    bool speed_varies;                 /* PktUART: an input filter that is right for every speed, at most 200 ns */
    unsigned drive_delay_clk;          /* 0..15, from enable to the start bit; PktUART version 0 with AUTO: at most 1 */
    unsigned tx_gap_bits, rx_gap_bits; /* PktUART, 11..256: between frames. The receiver's counts on during a byte;
                                          for frames the sender's is 1..256 */
};

/*
 * What was lost, and why. What arrives is in order always, and bytes received + rx_uncertain are never fewer than were
 * sent to the port, unless a UART's buffer ran over. For a PktUART on a line that rests for some periods they are as
 * many, but that the last word of a frame whose size was lost counts as four bytes; without such a rest the receiver is
 * cleared, which counts as 2047 bytes or more.
 *
 * A PktUART keeps 1020 bytes until the next cycles: 10 ms at 1 Mbaud without a pause, 88 ms at 115200. Its firmware
 * does not tell when more came, nor that a frame had more than 1023 bytes, so the driver goes by the time: when a cycle
 * comes later than that, what arrived is used if the frames' sizes show that it fitted, and the bytes that a frame of
 * more than 1023 can have had besides, in that time, count as uncertain; if it did not fit the receiver is cleared. No
 * more is sent than the receiver could keep if it came back, so a loop loses nothing however late a cycle is.
 */
struct hm2_serial_counts {
    uint32_t rx_bytes, tx_bytes;
    uint32_t rx_errors;    /* false starts, missing stop bits, wrong parity */
    uint32_t rx_overruns;  /* the card's buffers ran over, or no longer made sense, and were cleared */
    uint32_t rx_uncertain; /* bytes that may have been lost with a reply, or to a request that the network delivered
                              twice, at most (late replies are used; a request that never came took none) */
    uint32_t tx_uncertain; /* bytes of which nobody knows whether they were sent, or sent once, for the same reasons */
};

/* Port `unit` of a card that is set up, or NULL when it has none or the configuration does not use it. */
HM2_API struct hm2_serial *hm2_serial_port(struct hm2_board *board, enum hm2_serial_kind kind, unsigned unit);
/* Take part in the cycle from now on; between hm2_board_change_begin() and hm2_board_change_end(). Once more does
 * nothing. */
HM2_API int HM2_MUST_CHECK hm2_serial_open(struct hm2_serial *port, struct hm2_diag *diag);
/* Not while a cycle runs. HM2_ERR_RANGE with the reason. What the card's buffers hold is dropped, and frames that wait
 * here. */
HM2_API int HM2_MUST_CHECK hm2_serial_set(struct hm2_serial *port, const struct hm2_serial_settings *settings,
                                          struct hm2_diag *diag);
/* The settings as they were set last. */
HM2_API struct hm2_serial_settings hm2_serial_current(const struct hm2_serial *port);
/* By one thread besides the cycle: bytes taken or given; none where frames are carried. Realtime safe. */
HM2_API size_t hm2_serial_put(struct hm2_serial *port, const uint8_t *bytes, size_t len);
HM2_API size_t hm2_serial_get(struct hm2_serial *port, uint8_t *bytes, size_t size);
/* Bytes that were put and are not yet on their way. */
HM2_API size_t hm2_serial_waiting(const struct hm2_serial *port);
HM2_API struct hm2_serial_counts hm2_serial_counts(const struct hm2_serial *port);

/*
 * Frames, by the same thread, realtime safe.
 *
 * A frame that does not fit into one write, from 253 bytes on, is handed to the card in several cycles and sent when it
 * is there. When it is not known whether a write with a part of one arrived that frame is given up and counts as
 * tx_uncertain: the transmitter is cleared of its parts when it has sent the frames before. A received frame with an
 * error, or of which something is missing, is not given: its bytes count as rx_uncertain, besides rx_errors. So do
 * those of one that may have been longer than its size can tell, judged by the time as above: what is certain are 900
 * bytes, less what the line brings in a period.
 */
#define HM2_SERIAL_FRAME_BYTES 1020u /* as many as the card's buffer holds for certain */
/* 0; HM2_ERR_NOSPACE while too much waits; HM2_ERR_RANGE for no bytes or too many; HM2_ERR_STATE without frames. */
HM2_API int HM2_MUST_CHECK hm2_serial_put_frame(struct hm2_serial *port, const uint8_t *bytes, size_t len);
/* Bytes of the oldest frame that waits, 0 when there is none. */
HM2_API size_t hm2_serial_next_frame(struct hm2_serial *port);
/* Take it: at most `size` of its bytes, the rest is dropped. Returns how many. */
HM2_API size_t hm2_serial_get_frame(struct hm2_serial *port, uint8_t *bytes, size_t size);
/* More was lost, or may have been, in either direction, than at the call before: the counts have grown. */
HM2_API bool hm2_serial_lost(struct hm2_serial *port);

#endif
