/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A conversation with hm2host, or with LinuxCNC (linuxcnc_peer.h): commands go to its standard input, what they print
 * comes back. An error in a command ends nothing there. Failures end the test through Check.
 */
#ifndef TEST_TALK_H
#define TEST_TALK_H

#include "process.h"

struct talk {
    struct process host;
    unsigned lines; /* said so far */
};

/* Start hm2host with these options besides its own (NULL-terminated, may be NULL). */
void talk_start(struct talk *talk, const char *const *options);
/* Start another program that takes the same commands. */
void talk_start_host(struct talk *talk, const char *const *argv);
/* End of input: it unloads everything. Its exit status must be 0. */
void talk_end(struct talk *talk);

/* A command, or several, one a line, whose answer comes with that of the next one. */
void talk_say(struct talk *talk, const char *command);
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
