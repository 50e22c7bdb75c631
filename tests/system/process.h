/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Programs as the system tests meet them: started, waited for, spoken to by signals, with what they printed. Every
 * wait has a limit; a child dies with the test that started it. Failures of the harness itself end the test through
 * Check (ck_abort_msg).
 */
#ifndef TEST_PROCESS_H
#define TEST_PROCESS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/resource.h>
#include <sys/types.h>

/* Whether this build has a sanitizer that other programs cannot host in a module of ours. */
#if defined __has_feature
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define TEST_SANITIZED 1
#endif
#endif
#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
#define TEST_SANITIZED 1
#endif
#ifndef TEST_SANITIZED
#define TEST_SANITIZED 0
#endif

#define PROCESS_OUTPUT_BYTES (1024u * 1024u)

struct process {
    pid_t pid;
    int input;                       /* write end of stdin, -1 = it reads /dev/null */
    int output;                      /* read end of stdout and stderr together, -1 = closed */
    size_t len;                      /* of text, which is NUL terminated */
    char text[PROCESS_OUTPUT_BYTES]; /* all that it printed so far; more than fits is read and dropped */
    bool ended;
    int status;          /* exit status, 128 + signal when a signal ended it; valid when ended */
    struct rusage usage; /* valid when ended */
};

/* Start argv[0] (a path, or a name that is looked for in PATH). The process is large: keep it static. */
void process_start(struct process *process, const char *const *argv);
/* The same with a standard input that process_say() writes to; process_hush() ends it. */
void process_start_listening(struct process *process, const char *const *argv);
void process_say(const struct process *process, const char *text);
void process_hush(struct process *process);
/* Wait until it has printed a line that begins with `start`; false when it ended or limit_ms passed before. *line
 * (may be NULL) points at it, within text. */
bool process_wait_line(struct process *process, const char *start, int limit_ms, const char **line);
/* Start a program that has a reason not to run on every machine: true when it has printed a line that begins with
 * `start`; false when it has ended with status 77, and what it said, "SKIP: reason", printed. */
bool process_started_or_skipped(struct process *process, const char *const *argv, const char *start, int limit_ms);
/* Wait until it ends by itself; false after limit_ms. */
bool process_wait_end(struct process *process, int limit_ms);
/* Send a signal and wait for the end. SIGKILL after limit_ms. Returns its status. */
int process_stop(struct process *process, int signal, int limit_ms);
/* Start, wait for the end (SIGKILL after limit_ms), return the status. */
int process_run(struct process *process, const char *const *argv, int limit_ms);

/* Fail the test: print all that the program has printed, as Check's own messages are short, and say what is wrong. */
_Noreturn void process_give_up(const struct process *process, const char *what);

/* Full path of a program in PATH, or NULL. Static storage. */
const char *process_find(const char *program);
/* Full path of what the build made ("hm2sim"). Static storage, the last four calls stay valid. */
const char *process_built(const char *name);

/* A loopback address that no other test run on this machine uses at the same time: 127.x.y.z from the process number,
 * which leaves the well-known port free on each. `text` has room for 16 characters. */
void test_address(unsigned index, char text[16]);

#endif
