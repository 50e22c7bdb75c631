/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What components do outside the realtime threads: a thread of normal priority that prints or carries bytes, and the
 * sentences of a load.
 */
#ifndef MESSENGER_H
#define MESSENGER_H

#include <pthread.h>

#include <hm2/err.h>

#define MESSENGER_PRINTS_NS 100000000L /* often enough for people */

/* Call work() again and again, with pauses of pause_ns (below a second), until messenger_stop(). 0, or a negative errno
 * with a message. */
int messenger_start(const char *component, void (*work)(void), long pause_ns);
/* Nothing when it does not run. */
void messenger_stop(void);

/* A thread of normal priority, whatever the loader has, with a small stack (hosts lock their memory) and no signals.
 * 0 or an errno. */
int messenger_create(pthread_t *thread, void *(*run)(void *), void *argument);

#define MESSENGER_LINE 1000

/* Copy the next line of a text without its end, cut when it is very long; 0 at the end of the text. motmod, once
 * loaded, takes the formats of error messages apart itself and knows no '*': it would take the length in "%.*s" for the
 * string. */
int messenger_next_line(const char **text, char line[MESSENGER_LINE]);

/* The sentences of a diag, line by line, as "COMPONENT: SUBJECT: sentence". Warnings are printed without a level:
 * whoever loads a component shall see them, as hosts do not show the level of warnings, but LinuxCNC puts every error
 * on the operator's screen, and at every start these are none. */
void messenger_print_diag(const char *component, const char *subject, const struct hm2_diag *diag);

#endif
