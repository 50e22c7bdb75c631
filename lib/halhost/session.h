/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Interpreter of HAL commands on the process's HAL host, with halcmd's commands, rules and output.
 *
 * The host must be open (halhost_open) and stay open while a session runs commands. A session prints through its
 * options only; errors come back in diag, each sentence as "file:line: sentence".
 */
#ifndef HALHOST_SESSION_H
#define HALHOST_SESSION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>

enum hal_wait {
    HAL_WAIT_REACHED,     /* the time has come */
    HAL_WAIT_INTERRUPTED, /* a person wants this wait to end (SIGINT) */
    HAL_WAIT_TERMINATED,  /* the program shall end (SIGTERM) */
};

struct hal_session_options {
    void (*write)(void *context, const char *text, size_t length); /* output of commands */
    const char *(*environment)(void *context, const char *name);   /* NULL = no variables */
    /* Wait until CLOCK_MONOTONIC shows until_ns; 0 only asks for an interruption that is pending. NULL: `run` returns
     * at once. */
    enum hal_wait (*wait)(void *context, int64_t until_ns);
    bool files;   /* `source` may read files, `save` and `histogram` may write them */
    bool threads; /* `start` may start threads */
    void *context;
    bool json; /* `show` prints JSON */
};

struct hal_session;

/* options is copied. NULL = no memory. */
struct hal_session *hal_session_new(const struct hal_session_options *options);
void hal_session_free(struct hal_session *session);

/* Variables for [SECTION]NAME. */
int HM2_MUST_CHECK hal_session_read_ini(struct hal_session *session, const char *path, struct hm2_diag *diag);

/* Execute a file, or a text under a name for messages, up to the first error. */
int HM2_MUST_CHECK hal_session_run_file(struct hal_session *session, const char *path, struct hm2_diag *diag);
int HM2_MUST_CHECK hal_session_run_text(struct hal_session *session, const char *name, const char *text, size_t length,
                                        struct hm2_diag *diag);
/* The same for lines from the middle of something: first_line counts from 1. */
int HM2_MUST_CHECK hal_session_run_lines(struct hal_session *session, const char *name, unsigned first_line,
                                         const char *text, size_t length, struct hm2_diag *diag);

/* `quit` or `exit` was executed. */
bool hal_session_ended(const struct hal_session *session);

/* Run times of all threads as a table, as `timing` prints it. */
void hal_session_print_timing(struct hal_session *session);

/* ---- completion at a prompt ---- */

/* The next name that can stand where the last word of line begins (line ends at the cursor), in no particular order;
 * *state is 0 at first. Returns false when there are no more. */
bool hal_session_complete(const struct hal_session *session, const char *line, size_t *state, char *name, size_t size);

#endif
