/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Flight recorder: when the parts of the last cycles happened, so that a slow or lost cycle can be looked at
 * afterwards.
 *
 * A board that was told to record keeps its last cycles in a ring of its own. When a cycle is lost, or takes longer
 * than a limit, or somebody asks, recording goes on for some cycles and then stops: the ring is frozen with the cause
 * and what came before and after it. Whoever polls from outside realtime takes the frozen ring, writes it to a file,
 * and lets recording go on. Format of the file: man page hm2flight(5).
 */
#ifndef HM2_FLIGHT_H
#define HM2_FLIGHT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>

#define HM2_FLIGHT_MIN_CYCLES 64u
#define HM2_FLIGHT_MAX_CYCLES 65536u

enum hm2_flight_flag {
    HM2_FLIGHT_LOST = 1,       /* no good reply came in time */
    HM2_FLIGHT_WRITE_LOST = 2, /* the reply told that the write before had not arrived */
    HM2_FLIGHT_SLOW = 4,       /* longer than the limit */
    HM2_FLIGHT_FAILED = 8,     /* counted as a failed cycle, for whatever reason */
};

/* One cycle. Times in ns behind start_ns, 0 = did not happen. */
struct hm2_flight_cycle {
    int64_t start_ns;       /* link's clock, before the request was sent */
    uint32_t number;        /* of the cycle, from 1, wraps */
    uint32_t sent_ns;       /* the request was handed to the kernel */
    uint32_t received_ns;   /* the good reply was here */
    uint32_t decoded_ns;    /* pins were up to date, or the reply was given up */
    uint32_t write_ns;      /* the write function began */
    uint32_t written_ns;    /* and had sent its packet */
    uint16_t request_bytes; /* payload */
    uint16_t reply_bytes;   /* of a good reply */
    uint16_t write_bytes;
    uint8_t flags;         /* enum hm2_flight_flag */
    uint8_t bad_datagrams; /* late, repeated and malformed ones met while waiting; 255 = that many or more */
};

enum hm2_flight_cause { HM2_FLIGHT_BY_REQUEST, HM2_FLIGHT_BY_LOSS, HM2_FLIGHT_BY_SLOWNESS, HM2_FLIGHT_CAUSES };

/* What a file begins with. */
struct hm2_flight_head {
    char card[32];     /* prefix, "hm2_7i96s.0" */
    int64_t period_ns; /* of the thread */
    enum hm2_flight_cause cause;
    uint32_t cause_cycle; /* number of the cycle that stopped the recorder */
};

/* ---- text: one line each, with its newline ----------------------------------------------------------------------- */

#define HM2_FLIGHT_LINE_SIZE 256u

/* Return the characters that the line has (below HM2_FLIGHT_LINE_SIZE). Head: two lines in one text. */
HM2_API size_t hm2_flight_format_head(const struct hm2_flight_head *head, char line[2 * HM2_FLIGHT_LINE_SIZE]);
HM2_API size_t hm2_flight_format_cycle(const struct hm2_flight_cycle *cycle, char line[HM2_FLIGHT_LINE_SIZE]);
/* Parse a whole file of len characters, which need not be terminated. Calls cycle for each line in turn.
 * HM2_ERR_MALFORMED with the line's number in diag. */
HM2_API int HM2_MUST_CHECK hm2_flight_parse(const char *text, size_t len, struct hm2_flight_head *head,
                                            void (*cycle)(void *context, const struct hm2_flight_cycle *cycle),
                                            void *context, struct hm2_diag *diag);
/* "a request", "a lost cycle", "a slow cycle". */
HM2_API const char *hm2_flight_cause_name(enum hm2_flight_cause cause);

#endif
