/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A board on a simulated card, a 7I96S unless told otherwise, and the servo thread that runs it, in virtual time. */
#ifndef SERVO_RIG_H
#define SERVO_RIG_H

#include "unit.h"

#include <hm2/board.h>
#include <hm2/sim.h>

#define PERIOD_NS 1000000
#define WORK_NS   100000 /* of the thread, between read and write */
#define PREFIX    "hm2_7i96s.0."

struct servo_rig {
    struct sim_card *card;
    struct sim_net *net;
    struct link *link;
    struct hm2_board *board;
    struct hm2_plain_binder *plain;
    struct hm2_diag diag;
    int64_t start_ns;         /* of the present period */
    int64_t period_ns;        /* by the clock of the network and the card; the thread believes in PERIOD_NS */
    int64_t read_ns, work_ns; /* what the last read took; what the thread takes */
    struct sim_faults reply_faults;
    bool spoil_reply;
};

/* Fixtures of cmocka. */
int servo_set_up(void **state);
int servo_set_up_card(void **state, const struct sim_card_options *options); /* another card */
int servo_tear_down(void **state);

double servo_get(const struct servo_rig *rig, const char *name);
void servo_set(const struct servo_rig *rig, const char *name, double value);
int servo_try_load(struct servo_rig *rig, const char *config); /* 0 or an error of the board's, told in diag */
void servo_load(struct servo_rig *rig, const char *config);
/* A thread that begins its cycle on time, or as soon as the one before has ended. */
void servo_cycle(struct servo_rig *rig);
void servo_cycles(struct servo_rig *rig, unsigned count);
/* What the network does from now on. */
void servo_faults(const struct servo_rig *rig, const struct sim_faults *faults);
void servo_no_faults(const struct servo_rig *rig);
/* It does that from the reply to the next datagram on. */
void servo_spoil_next_reply(struct servo_rig *rig, const struct sim_faults *how);
/* One of the messages so far has these words. */
bool servo_message(const struct servo_rig *rig, const char *words);

#endif
