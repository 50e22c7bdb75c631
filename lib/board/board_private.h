/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Inside of a board: shared by the files of lib/board and their tests. */
#ifndef BOARD_PRIVATE_H
#define BOARD_PRIVATE_H

#include <stdalign.h>
#include <stdatomic.h>

#include <hm2/board.h>
#include <hm2/module.h>

#include "adaptive.h"
#include "flight.h"
#include "notice.h"
#include "pipeline.h"
#include "rtt.h"

#define BOARD_STEM_SIZE   8u
#define BOARD_PREFIX_SIZE 32u
#define BOARD_MODULES     HM2_MAX_MODULES

/* ---- points of the board itself (hal-interface 2.1, and counters by cause) --------------------------------------- */

struct board_points {
    hm2_bit_t *io_error;
    hm2_s32_t *read_timeout, *error_limit, *error_increment, *error_decrement;
    hm2_bit_t *error, *error_exceeded;
    hm2_u32_t *error_total;
    hm2_s32_t *error_level;
    hm2_u32_t *lost, *late, *stale, *malformed, *strangers, *write_lost;
    hm2_u32_t *data_age;
    hm2_float_t *rtt_min_us, *rtt_us, *rtt_max_us;
    hm2_bit_t *rtt_reset;
    hm2_bit_t *position_lost;
    hm2_bit_t *auto_rearm;
    hm2_u32_t *rearms;
};

int board_points_bind(struct hm2_board *board, struct hm2_binder *binder, struct hm2_diag *diag);

/* ---- exchanges outside the cycle: one request, one proven reply ----------------------------------------------------
 */

struct board_exchange {
    struct lbp16_builder builder; /* add reads and writes between begin and run */
    size_t nonce_at, echo_at;     /* of the nonce in the request and in the reply */
    uint32_t nonce;
    uint8_t request[LBP16_MAX_REQUEST_BYTES];
    uint8_t reply[LBP16_MAX_REPLY_BYTES + 1u]; /* longer than a good reply, so that a long one is noticed */
};

/* Datagrams looked at while one reply is waited for: a flood of wrong ones cannot hold the thread beyond its deadline
 * anyway, but a link whose clock stands still must not hold it for ever. */
#define BOARD_MAX_DATAGRAMS 64u

/* How long a set-up exchange may take: about one second in all. */
#define BOARD_TRIES     5u
#define BOARD_TRY_NS    INT64_C(200000000)
#define BOARD_NONCE_BIT 0x80000000u /* the plan's sequence numbers count from 0 and do not get here */

void board_exchange_begin(struct hm2_board *board, struct board_exchange *exchange);
/* Append the echo; to be called last, by run() or by who keeps the request. */
int board_exchange_seal(struct board_exchange *exchange);
/* Is this the reply to the sealed request? Realtime safe. */
bool board_exchange_matches(const struct board_exchange *exchange, size_t len);
/* Send until answered. 0, or the error of the last try. */
int HM2_MUST_CHECK board_exchange_run(struct hm2_board *board, struct board_exchange *exchange, unsigned tries,
                                      int64_t try_ns);

int HM2_MUST_CHECK board_peek(struct hm2_board *board, uint16_t address, unsigned words, uint32_t *values);
int HM2_MUST_CHECK board_poke(struct hm2_board *board, uint16_t address, unsigned words, const uint32_t *values,
                              unsigned tries, int64_t try_ns);

/* ---- identity -----------------------------------------------------------------------------------------------------
 */

/* Where the words of a struct hm2_image stand in the reply to the one request that reads them all. */
struct board_image_request {
    size_t id_at, rom_at[3];
};

/* Add the reads of cookie area and ROM (at the place that pointer, register 0x010C, gives). */
void board_image_add(struct lbp16_builder *builder, struct board_image_request *where, uint16_t rom_address);
void board_image_take(const uint8_t *reply, const struct board_image_request *where, struct hm2_image *image);

/* ---- coming back after a power loss ---------------------------------------------------------------------------------
 */

enum board_recovery {
    BOARD_NORMAL,
    BOARD_ASKS_IDENTITY, /* the card lost its state: nothing but identity requests are sent */
    BOARD_RESTORES,      /* same firmware: set-up is sent again, with all outputs off, until it is confirmed */
};

/* A condition of the board that people hear about; continues enum hm2_notice in struct board_event. */
enum board_event_kind {
    BOARD_EVENT_PACKET_ERROR,     /* words: enum board_error_word */
    BOARD_EVENT_EXCEEDED,         /* the same */
    BOARD_EVENT_POWER_LOSS,       /* the card lost its state */
    BOARD_EVENT_RESTORED,         /* and was set up again */
    BOARD_EVENT_FOREIGN_FIRMWARE, /* words: enum board_foreign_word */
    BOARD_EVENT_PIPELINE_RUNS,    /* words: enum board_pipeline_word */
    BOARD_EVENT_PIPELINE_FALLS,   /* the same: too many replies were late */
    BOARD_EVENT_PIPELINE_NO_ROOM, /* the same: a period is too short for it */
    BOARD_EVENT_PIPELINE_NO_TIME, /* the same: the card's timer fires before transfers are over */
    BOARD_EVENTS
};

enum board_error_word {
    BOARD_ERROR_TOTAL,
    BOARD_ERROR_LOST,
    BOARD_ERROR_LATE,
    BOARD_ERROR_STALE,
    BOARD_ERROR_MALFORMED,
    BOARD_ERROR_WRITE_LOST,
    BOARD_ERROR_SEND,
};

enum board_foreign_word {
    BOARD_FOREIGN_CONFIG,         /* two words of text */
    BOARD_FOREIGN_BOARD = 2,      /* two words of text */
    BOARD_FOREIGN_FINGERPRINT = 4 /* low word first */
};

enum board_pipeline_word {
    BOARD_PIPELINE_WORK_US,
    BOARD_PIPELINE_WAIT_US,
    BOARD_PIPELINE_RTT_US,
    BOARD_PIPELINE_PERIOD_US,
    BOARD_PIPELINE_LATE,
    BOARD_PIPELINE_EARLY,
    BOARD_PIPELINE_TIMER_US,
    BOARD_PIPELINE_NEED_US,
};

/* Words of HM2_NOTICE_WATCHDOG_BIT, which the board adds. */
enum board_bite_word { BOARD_BITE_REASON, BOARD_BITE_GAP_US, BOARD_BITE_PERIOD_US };

enum board_bite_reason { BOARD_BITE_UNKNOWN, BOARD_BITE_PACKET_LOSS, BOARD_BITE_LATE_WRITE };

/* What the cycle calls: only functions that exist, of modules that are in use. */
struct board_calls {
    unsigned count;
    struct board_call {
        void (*function)(struct hm2_module *module, const struct hm2_cycle *cycle);
        struct hm2_module *module;
    } call[BOARD_MODULES];
};

struct board_buffer {
    uint8_t *bytes;
    size_t size;
};

enum board_state { BOARD_NEW, BOARD_IDENTIFIED, BOARD_SET_UP, BOARD_RUNS, BOARD_STOPPED };

struct hm2_board {
    enum board_state state;
    struct link *link;
    uint32_t nonce;

    char card_name[HM2_BOARD_NAME_BYTES + 1u];
    char stem[BOARD_STEM_SIZE];
    char prefix[BOARD_PREFIX_SIZE];
    struct hm2_board_type type; /* the table's row; of an unknown card completed from its name and IDROM */
    struct hm2_image image;
    struct hm2_idrom idrom;
    struct hm2_config config;

    struct hm2_pin pins[HM2_MAX_PINS];
    unsigned module_count;
    struct hm2_module modules[BOARD_MODULES]; /* in the order of hm2_module_types[] */
    struct hm2_module *watchdog;              /* NULL = the firmware has none */
    struct board_calls unpacks, packs;
    struct board_buffer reply; /* of the plan */
    struct hm2_plan *plan;
    struct board_points *points;
    struct board_flight *flight; /* NULL = cycles are not recorded */

    /* the cycle */
    bool outstanding, sent; /* a request waits for read(); it could be sent */
    int64_t request_ns, period_ns;
    int64_t read_ns; /* when read began, or the plain request it waits for was sent */
    struct board_pipeline pipeline;
    struct board_adaptive adaptive;
    struct board_rtt rtt;                       /* of plain requests, while one of these two uses it */
    int64_t received_ns;                        /* of the good reply to the last request; 0 = none */
    int64_t read_limit_ns, limit_for_period_ns; /* how long a reply is waited for, and what that was computed from */
    int32_t limit_for_setting;
    struct hm2_cycle cycle;   /* as the modules are told */
    uint32_t writes;          /* since start() or since the card came back */
    int64_t write_ns;         /* when the last write was sent, valid with writes > 0 */
    int64_t unpacked_ns;      /* now_ns of the last unpack */
    int64_t pet_ns;           /* when the first write after it was sent */
    bool petted;              /* there was one */
    int64_t write_gap_ns;     /* longest time between two writes since the last good reply */
    uint32_t cycles;          /* of read */
    uint32_t last_loss_cycle; /* when a request or a write was lost */
    bool lossy;               /* there was one */
    bool rtt_known;
    bool bitten;      /* as of the last good cycle: outputs are off until has_bit is cleared */
    int64_t rearm_ns; /* how long auto-rearm has waited */

    enum board_recovery recovery;
    bool foreign; /* the card came back with other firmware */
    struct board_exchange identity;
    struct board_image_request identity_at;

    int64_t event_ns[BOARD_EVENTS];
    bool event_seen[BOARD_EVENTS];
    struct board_notices notices;
    uint32_t overflows_told; /* of the message's reader */

    alignas(max_align_t) unsigned char plan_memory[];
};

/* Account for a cycle (hal-interface 3.5). Returns with io_error set when the level has reached its limit. */
void board_cycle_failed(struct hm2_board *board, bool raise_level);
void board_cycle_good(struct hm2_board *board);
/* Time after the request at which a reply is given up (hal-interface 3.4). */
int64_t board_read_limit_ns(int32_t setting, int64_t period_ns);

/* Report an event of the board, each kind at most once in NOTICE_ABSENT_NS. Realtime safe. */
void board_event(struct hm2_board *board, enum board_event_kind kind, const struct board_event *facts);
int64_t board_write_gap_ns(const struct hm2_board *board);
enum board_bite_reason board_bite_reason(const struct hm2_board *board);

/* The card has lost its state: from now on its identity is asked for. Realtime safe, as all of these. */
void board_recovery_begin(struct hm2_board *board);
/* The identity request with a new number. */
const uint8_t *board_recovery_request(struct hm2_board *board);
/* Judge the image in the identity reply: restore, or refuse. */
void board_recovery_identified(struct hm2_board *board);
/* Everything is confirmed, and a reply of the card in its new life is in the windows. */
void board_recovery_end(struct hm2_board *board);

/* Realtime safe. While io_error stops the board, once a cycle: auto-rearm may set it to 0. */
void board_rearm_io(struct hm2_board *board);
/* Once in every good cycle in which the watchdog has bitten, or had bitten in the cycle before. */
void board_stay_bitten(struct hm2_board *board, bool bitten);

void board_start_modules(struct hm2_board *board);
/* Facts of the present cycle; valid until the next call. */
struct hm2_cycle *board_cycle(struct hm2_board *board, int64_t now_ns, bool bitten);

#endif
