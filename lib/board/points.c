/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Points of the board itself: those of hal-interface 2.1, and counters by cause and round-trip times beside them. */
#include "board_private.h"

#define P(field, name, type, dir, init, unit, help) \
    HM2_POINT(struct board_points, field, name, type, dir, init, unit, help)

static const struct hm2_point points[] = {
    P(io_error, "io_error", HM2_BIT, HM2_PARAM_RW, 0, "",
      "1 = too many failed cycles, or other firmware: nothing is sent; set to 0 to resume"),
    P(read_timeout, "packet-read-timeout", HM2_S32, HM2_PARAM_RW, 80, "% or ns",
      "time after the request to wait for the reply: below 100 percent of the period, else ns; at least 100 us"),
    P(error_limit, "packet-error-limit", HM2_S32, HM2_PARAM_RW, 10, "", "level at which io_error is raised"),
    P(error_increment, "packet-error-increment", HM2_S32, HM2_PARAM_RW, 2, "", "added to the level by a failed cycle"),
    P(error_decrement, "packet-error-decrement", HM2_S32, HM2_PARAM_RW, 1, "", "taken from the level by a good cycle"),
    P(error, "packet-error", HM2_BIT, HM2_PIN_OUT, 0, "", "this cycle failed"),
    P(error_total, "packet-error-total", HM2_U32, HM2_PIN_IO, 0, "cycles", "failed cycles; may be set to 0"),
    P(error_level, "packet-error-level", HM2_S32, HM2_PIN_OUT, 0, "", "rises with failed cycles, falls with good ones"),
    P(error_exceeded, "packet-error-exceeded", HM2_BIT, HM2_PIN_OUT, 0, "", "the level has reached its limit"),
    P(lost, "packet-lost", HM2_U32, HM2_PIN_OUT, 0, "cycles", "cycles without a good reply before the deadline"),
    P(late, "packet-late", HM2_U32, HM2_PIN_OUT, 0, "packets", "replies that came after their cycle had given them up"),
    P(stale, "packet-stale", HM2_U32, HM2_PIN_OUT, 0, "packets", "replies that came once more"),
    P(malformed, "packet-malformed", HM2_U32, HM2_PIN_OUT, 0, "packets", "replies of wrong length or to no request"),
    P(strangers, "packet-strangers", HM2_U32, HM2_PIN_OUT, 0, "packets", "datagrams that did not come from the card"),
    P(write_lost, "write-lost", HM2_U32, HM2_PIN_OUT, 0, "packets", "writes that the card did not receive"),
    P(position_lost, "position-lost", HM2_BIT, HM2_PIN_IO, 0, "",
      "1 = the watchdog has bitten or the card lost its power: home again, then set to 0"),
    P(auto_rearm, "auto-rearm", HM2_BIT, HM2_PIN_IN, 0, "",
      "1 = io_error and watchdog.has_bit are set to 0 without a person when the card answers again"),
    P(rearms, "auto-rearms", HM2_U32, HM2_PIN_OUT, 0, "", "times that auto-rearm has set watchdog.has_bit to 0"),
    P(data_age, "data-age", HM2_U32, HM2_PIN_OUT, 0, "cycles", "cycles since the inputs were updated; 0 = this one"),
    P(rtt_min_us, "rtt-min-us", HM2_FLOAT, HM2_PIN_OUT, 0, "us", "shortest time from request to reply"),
    P(rtt_us, "rtt-us", HM2_FLOAT, HM2_PIN_OUT, 0, "us", "time from request to reply, last cycle"),
    P(rtt_max_us, "rtt-max-us", HM2_FLOAT, HM2_PIN_OUT, 0, "us", "longest time from request to reply"),
    P(rtt_reset, "rtt-reset", HM2_BIT, HM2_PIN_IO, 0, "", "set to 1 to start the shortest and longest anew"),
};

#define F(field, name, type, dir, init, unit, help) \
    HM2_POINT(struct board_flight_points, field, name, type, dir, init, unit, help)

static const struct hm2_point flight_points[] = {
    F(freeze, "flight.freeze", HM2_BIT, HM2_PIN_IO, 0, "", "set to 1 to have the last cycles written to a file"),
    F(freezes, "flight.freezes", HM2_U32, HM2_PIN_OUT, 0, "",
      "times that the recorder has stopped for a lost or slow cycle, or on request"),
};
#define FLIGHT_POINTS (sizeof flight_points / sizeof flight_points[0])

#define L(field, name, type, dir, init, unit, help) \
    HM2_POINT(struct board_pipeline_points, field, name, type, dir, init, unit, help)

static const struct hm2_point pipeline_points[] = {
    L(active, "pipeline.active", HM2_BIT, HM2_PIN_OUT, 0, "", "1 = inputs are read ahead; 0 = plain cycles"),
    L(margin_us, "pipeline.margin-us", HM2_FLOAT, HM2_PIN_OUT, 0, "us",
      "time that nearly every reply is there before it is read; negative = the read waited so long"),
    L(data_age_us, "pipeline.data-age-us", HM2_FLOAT, HM2_PIN_OUT, 0, "us", "age of the inputs when they are read"),
    L(wait_us, "pipeline.wait-us", HM2_U32, HM2_PIN_OUT, 0, "us", "time that the card has waited for its timer"),
    L(late, "pipeline.late", HM2_U32, HM2_PIN_OUT, 0, "cycles", "replies that the read had to wait for"),
    L(early, "pipeline.early", HM2_U32, HM2_PIN_OUT, 0, "cycles", "replies that were read before transfers were over"),
    L(falls, "pipeline.falls", HM2_U32, HM2_PIN_OUT, 0, "", "returns to plain cycles because replies were late"),
};
#define PIPELINE_POINTS (sizeof pipeline_points / sizeof pipeline_points[0])

#define A(field, name, type, dir, init, unit, help) \
    HM2_POINT(struct board_adaptive_points, field, name, type, dir, init, unit, help)

static const struct hm2_point adaptive_points[] = {
    A(deadline_us, "adaptive.deadline-us", HM2_FLOAT, HM2_PIN_OUT, 0, "us",
      "time after the request at which its reply is taken for lost"),
    A(requests, "adaptive.requests", HM2_U32, HM2_PIN_OUT, 0, "packets", "second requests in a cycle"),
    A(saved, "adaptive.saved", HM2_U32, HM2_PIN_OUT, 0, "cycles", "cycles that had a good reply after one"),
};
#define ADAPTIVE_POINTS (sizeof adaptive_points / sizeof adaptive_points[0])

static const struct hm2_point_group groups[] = {
    {"", points, sizeof points / sizeof points[0], NULL},
    {"", flight_points, FLIGHT_POINTS, "with flight_folder="},
    {"", pipeline_points, PIPELINE_POINTS, "with pipelined= in config"},
    {"", adaptive_points, ADAPTIVE_POINTS, "with adaptive_timeout or second_request in config"},
    {NULL, NULL, 0, NULL},
};

const struct hm2_point_group *hm2_board_point_groups(void)
{
    return groups;
}

/* bound: memory from the host, or NULL when it gave none. */
static int bind_table(const struct hm2_board *const board, struct hm2_binder *const binder,
                      const struct hm2_point *const table, const size_t count, void *const bound,
                      struct hm2_diag *const diag)
{
    if (!bound)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "%s: the host gave no memory for the points %s and on", board->prefix,
                            table[0].name);
    return hm2_bind_points(binder, table, count, bound, board->prefix, 0, diag);
}

static int bind_flight(struct hm2_board *const board, struct hm2_binder *const binder, struct hm2_diag *const diag)
{
    struct board_flight_points *const bound = binder->alloc(binder, sizeof *bound);
    board->flight->points = bound;
    return bind_table(board, binder, flight_points, FLIGHT_POINTS, bound, diag);
}

static int bind_pipeline(struct hm2_board *const board, struct hm2_binder *const binder, struct hm2_diag *const diag)
{
    struct board_pipeline_points *const bound = binder->alloc(binder, sizeof *bound);
    board->pipeline.points = bound;
    return bind_table(board, binder, pipeline_points, PIPELINE_POINTS, bound, diag);
}

static int bind_adaptive(struct hm2_board *const board, struct hm2_binder *const binder, struct hm2_diag *const diag)
{
    struct board_adaptive_points *const bound = binder->alloc(binder, sizeof *bound);
    board->adaptive = (struct board_adaptive){.on = true, .asks_again = board->config.second_request, .points = bound};
    return bind_table(board, binder, adaptive_points, ADAPTIVE_POINTS, bound, diag);
}

int board_points_bind(struct hm2_board *const board, struct hm2_binder *const binder, struct hm2_diag *const diag)
{
    board->points = binder->alloc(binder, sizeof *board->points);
    int err = bind_table(board, binder, points, sizeof points / sizeof points[0], board->points, diag);
    if (err == 0 && board->flight)
        err = bind_flight(board, binder, diag);
    if (err == 0 && board->config.pipelined > 0)
        err = bind_pipeline(board, binder, diag);
    if (err == 0 && board->config.adaptive_timeout)
        err = bind_adaptive(board, binder, diag);
    return err;
}
