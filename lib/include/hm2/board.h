/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A card as a whole: identify it, set its modules up, run its cycle, survive what the network and the mains do to it.
 *
 * Set-up (identify, setup, start) and stop() talk to the card and wait; call them outside realtime. request(), read()
 * and write() are the cycle: realtime safe, one send each for request and write, and the receives for the reply.
 * One thread at a time per board; different boards are independent.
 *
 * A cycle's inputs are applied whole or not at all. Semantics of the packet-error points, io_error and has_bit are
 * LinuxCNC's (hal-interface 3.4, 3.5) with the verdicts of its section 8.
 */
#ifndef HM2_BOARD_H
#define HM2_BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/config.h>
#include <hm2/err.h>
#include <hm2/flight.h>
#include <hm2/idrom.h>
#include <hm2/link.h>
#include <hm2/module.h>
#include <hm2/plan.h>
#include <hm2/points.h>

#define HM2_BOARD_CONNECTORS 4u

/* What a card's name tells (hal-interface 1.3). */
struct hm2_board_type {
    const char *name;              /* compared with the 16 characters of LBP16 space 7 */
    unsigned compared;             /* characters compared, terminating zeros included */
    const char *stem;              /* HAL name: "7i96s" */
    unsigned io_ports, port_width; /* 0 = any: from the IDROM */
    const char *connectors[HM2_BOARD_CONNECTORS];
    unsigned leds;
    const char *terminals[HM2_BOARD_CONNECTORS]; /* hm2_terminals_find(); NULL: connector and pin number are printed */
};

#define HM2_BOARD_NAME_BYTES 16u

/* Row for a card name (longest match first); for an unknown card the catch-all row, never NULL. At most
 * HM2_BOARD_NAME_BYTES characters are looked at: a name of that length needs no terminating zero. */
HM2_API const struct hm2_board_type *hm2_board_type_find(const char *name);
/* The table, for listings and tests: NULL behind its last row, the catch-all, whose stem and name are "". */
HM2_API const struct hm2_board_type *hm2_board_type_at(size_t index);

struct hm2_board;

/* Allocates a board (the only allocation; everything a cycle needs is inside or comes from the binder). */
HM2_API struct hm2_board *hm2_board_new(void);
/* Does not stop the card: see hm2_board_stop(). Closes the link. */
HM2_API void hm2_board_free(struct hm2_board *board);

/* Take the link over, read the card's name, cookie and IDROM, and check them. Retries lost packets; gives up after
 * about one second. Afterwards the getters below work. */
HM2_API int HM2_MUST_CHECK hm2_board_identify(struct hm2_board *board, struct link *link, struct hm2_diag *diag);
/* The board's own copy of its row, completed for unknown cards: compare stems, not pointers. */
HM2_API const struct hm2_board_type *hm2_board_type(const struct hm2_board *board);
HM2_API const struct hm2_idrom *hm2_board_idrom(const struct hm2_board *board);
HM2_API const char *hm2_board_card_name(const struct hm2_board *board);
HM2_API const char *hm2_board_prefix(const struct hm2_board *board); /* "hm2_7i96s.0", after setup */

/* Create every module and point of the card. index is the number of this card among cards of the same stem. */
HM2_API int HM2_MUST_CHECK hm2_board_setup(struct hm2_board *board, unsigned index, struct hm2_binder *binder,
                                           const char *config, struct hm2_diag *diag);
/* Bring the card into its defined idle state (outputs inactive), read it once and take its counters as the start. */
HM2_API int HM2_MUST_CHECK hm2_board_start(struct hm2_board *board, struct hm2_diag *diag);
/* Make the watchdog bite, so that every output goes to its safe state. Best effort, also after a failed set-up. */
HM2_API void hm2_board_stop(struct hm2_board *board);

/* The cycle. period_ns is the thread's. */
HM2_API void hm2_board_request(struct hm2_board *board, int64_t period_ns);
/* Sends the request first when none is outstanding. */
HM2_API void hm2_board_read(struct hm2_board *board, int64_t period_ns);
HM2_API void hm2_board_write(struct hm2_board *board, int64_t period_ns);
HM2_API bool hm2_board_request_outstanding(const struct hm2_board *board);

/* Add to what travels in every cycle after set-up (hm2/bspi.h, hm2/serial.h): between begin and end no function of the
 * cycle may run; a request that is outstanding is given up. end lays the packets out again: when it fails, with the
 * reason in diag, the card can only be stopped. */
HM2_API void hm2_board_change_begin(struct hm2_board *board);
HM2_API int HM2_MUST_CHECK hm2_board_change_end(struct hm2_board *board, struct hm2_diag *diag);
/* The module of this kind that a card in use has, or NULL. For lib/module. */
HM2_API struct hm2_module *hm2_board_module(struct hm2_board *board, uint8_t gtag);

/* ---- service: an identified card that is not set up ----------------------------------------------------------- */

struct sslbp_port;

/* HM2_ERR_STATE when another program talks to the card; listens for 60 ms. */
HM2_API int HM2_MUST_CHECK hm2_board_undriven(struct hm2_board *board, struct hm2_diag *diag);
/* A smart-serial port (hm2/sslbp.h), stopped, with its pins driven and all others of the card inputs. access keeps
 * pointers to board and diag. HM2_ERR_NOTFOUND, or what sslbp_port_open() says. */
HM2_API int HM2_MUST_CHECK hm2_board_sserial_open(struct hm2_board *board, unsigned port, struct sslbp_port *access,
                                                  struct hm2_diag *diag);
/* Stop it; no pin is driven any more. */
HM2_API void hm2_board_sserial_close(struct hm2_board *board, const struct sslbp_port *access);

/* What happened, for people. Not realtime; may run in another thread than the cycle. Returns 1 with one sentence in
 * text and its severity in *error (true = an operator must know), 0 when there is nothing new. */
HM2_API int hm2_board_next_message(struct hm2_board *board, char *text, size_t size, bool *error);

/* Record the times of the last cycles (rounded up to a power of two), and stop for a lost one and for one that takes
 * longer than slow_ns (0 = no limit). Before setup; not realtime. Adds the points flight.*. */
HM2_API int HM2_MUST_CHECK hm2_board_record(struct hm2_board *board, unsigned cycles, int64_t slow_ns,
                                            struct hm2_diag *diag);
/* Not realtime, and may run in another thread than the cycle: number of cycles in a recorder that has stopped, with
 * what stopped it in *head; 0 while it records. Until hm2_board_flight_resume() they can be read, the oldest as index
 * 0. */
HM2_API unsigned hm2_board_flight(const struct hm2_board *board, struct hm2_flight_head *head);
HM2_API struct hm2_flight_cycle hm2_board_flight_cycle(const struct hm2_board *board, unsigned index);
HM2_API void hm2_board_flight_resume(struct hm2_board *board);

/* Payload bytes of the cycle's datagrams and what they hold; after setup. */
HM2_API struct hm2_plan_sizes hm2_board_sizes(const struct hm2_board *board);

/* Tables of the board's own points, for documentation; ends with a row whose points are NULL. */
HM2_API const struct hm2_point_group *hm2_board_point_groups(void);

/* Listing of pins by terminal name and owner, one line a pin, as printed at load. Returns characters needed. */
HM2_API size_t hm2_board_describe_pins(const struct hm2_board *board, char *text, size_t size);

#endif
