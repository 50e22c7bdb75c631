/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The pipelined cycle (docs/pipelined-cycle.md): whether a write is a turn, which also asks for the inputs of the next
 * period, and what is known of the room there is for that. Realtime safe.
 */
#ifndef BOARD_PIPELINE_H
#define BOARD_PIPELINE_H

#include <stdbool.h>
#include <stdint.h>

#include <hm2/points.h>

struct hm2_board;

struct board_pipeline_points {
    hm2_bit_t *active;
    hm2_float_t *margin_us, *data_age_us;
    hm2_u32_t *wait_us, *late, *early, *falls;
};

struct board_pipeline {
    unsigned timer; /* 0 = not asked for: nothing else is used */
    bool runs;
    bool settled;           /* the second turn since then was sent */
    bool turned;            /* the last request was a turn */
    unsigned level;         /* rises with late and lost replies, falls with good ones */
    int64_t work_ns;        /* from the reply to the write, with its peaks */
    int64_t need_ns;        /* between a write and the reads, for what writes start */
    int64_t timeout_ns;     /* how long the card waits at most */
    int64_t rtt_ns;         /* that nearly all replies need without waiting */
    int64_t started_ns;     /* when it was switched on */
    int64_t plain_until_ns; /* earliest time to try again */
    int64_t pause_ns;       /* after the next fall */
    uint32_t looked;        /* cycle in which the room was computed last */
    struct board_pipeline_points *points;
};

/* Of cards that were asked to pipeline: once in every write, after the modules have packed: shall it be a turn? */
bool board_pipeline_turns(struct hm2_board *board, int64_t now_ns);
/* For hm2_plan_turn(). */
uint16_t board_pipeline_timeout_us(const struct hm2_board *board);
/* Plain cycles from now on, until there is room again. */
void board_pipeline_stop(struct hm2_board *board);
/* Whenever modules have been set up or changed: how long their transfers take. */
void board_pipeline_measure(struct hm2_board *board);
/* The same at load: that becomes the timer's offset, unless it is longer. */
void board_pipeline_setup(struct hm2_board *board);
/* At load: the plan's turns are too long. */
void board_pipeline_warn(const struct hm2_board *board, struct hm2_diag *diag);
/* The same: the modules have unpacked the reply to a turn. */
void board_pipeline_unpacked(struct hm2_board *board);
/* The same: a good reply; when it answers a turn: was it there when read began? */
void board_pipeline_received(struct hm2_board *board, bool on_time);
/* The reply to a turn did not come. */
void board_pipeline_lost(struct hm2_board *board);
/* When the inputs in the last reply were read by the card, as far as the host can tell. */
int64_t board_pipeline_sample_ns(const struct hm2_board *board);

#endif
