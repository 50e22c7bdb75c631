/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A conversation with hm2host: commands go to its standard input, what they print comes back. An error in a command
 * ends nothing there. Failures end the test through Check.
 */
#ifndef TEST_TALK_H
#define TEST_TALK_H

#include "process.h"

struct talk {
    struct process host;
    unsigned asked;
};

/* Start hm2host with these options besides its own (NULL-terminated, may be NULL). */
void talk_start(struct talk *talk, const char *const *options);
/* End of input: hm2host unloads everything. Its exit status must be 0. */
void talk_end(struct talk *talk);

/* What a command prints, errors and messages that happen to come meanwhile included; static storage. */
const char *talk_try(struct talk *talk, const char *command);
/* Commands, one a line, none of which may fail. */
void talk_do(struct talk *talk, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* Value of a pin or parameter; bits are 0 and 1. */
double talk_value(struct talk *talk, const char *name);
/* Wait until a value is from `low` to `high`. */
void talk_wait(struct talk *talk, const char *name, double low, double high);
/* Wait until this text has been printed since the start. */
void talk_wait_text(struct talk *talk, const char *text);

#endif
