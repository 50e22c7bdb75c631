/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "talk.h"

#include <check.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define ANSWER_MS   30000
#define END_MS      30000
#define WAIT_STEPS  2000u
#define STEP_US     10000
#define MAX_ARGS    24
#define MARK_BYTES  48
#define SHOWN_BYTES 2000u /* of what was said, in a failure; Check takes no more than some kilobytes */

void talk_start_host(struct talk *const talk, const char *const *const argv)
{
    talk->lines = 0;
    process_start_listening(&talk->host, argv);
}

void talk_start(struct talk *const talk, const char *const *options)
{
    const char *argv[MAX_ARGS] = {process_built("hm2host"), "-i"};
    unsigned n = 2;
    for (; options && *options; options++)
        argv[n++] = *options;
    argv[n] = NULL;
    talk_start_host(talk, argv);
}

void talk_end(struct talk *const talk)
{
    process_hush(&talk->host);
    if (!process_wait_end(&talk->host, END_MS))
        ck_abort_msg("it does not end: %s", talk->host.text);
    if (talk->host.status != 0)
        ck_abort_msg("it ended with %d: %.4000s", talk->host.status, talk->host.text);
    (void)process_stop(&talk->host, 0, 0);
}

void talk_say(struct talk *const talk, const char *const command)
{
    talk->lines++;
    for (const char *at = command; *at; at++)
        talk->lines += *at == '\n';
    process_say(&talk->host, command);
    process_say(&talk->host, "\n");
}

/* `print` tells the number of its line, in hm2host as in LinuxCNC's halcmd: this marks the end of an answer. */
const char *talk_try(struct talk *const talk, const char *const command)
{
    static char answer[PROCESS_OUTPUT_BYTES];
    char mark[MARK_BYTES];
    const size_t before = talk->host.len;
    talk_say(talk, command);
    talk_say(talk, "print =");
    snprintf(mark, sizeof mark, "<stdin>:%u: HALCMD MSG: =", talk->lines);
    const char *line;
    if (!process_wait_line(&talk->host, mark, ANSWER_MS, &line))
        ck_abort_msg("no answer to \"%s\": %s", command, talk->host.text + before);
    const size_t answer_len = (size_t)(line - talk->host.text) - before;
    memcpy(answer, talk->host.text + before, answer_len);
    answer[answer_len] = '\0';
    return answer;
}

void talk_do(struct talk *const talk, const char *const format, ...)
{
    char command[8000];
    va_list args;
    va_start(args, format);
    const int len = vsnprintf(command, sizeof command, format, args);
    va_end(args);
    ck_assert_uint_lt((size_t)len, sizeof command);
    const char *const answer = talk_try(talk, command);
    if (strstr(answer, "<stdin>:"))
        ck_abort_msg("%s: %s", command, answer);
}

/* The line of the answer that is a value; messages may have come in between. */
static bool find_value(const char *line, double *const value)
{
    for (; *line; line += strcspn(line, "\n"), line += *line == '\n') {
        char *end;
        const bool yes = strncmp(line, "TRUE\n", 5) == 0;
        if (yes || strncmp(line, "FALSE\n", 6) == 0) {
            *value = yes;
            return true;
        }
        *value = strtod(line, &end);
        if (end != line && *end == '\n')
            return true;
    }
    return false;
}

double talk_value(struct talk *const talk, const char *const name)
{
    char command[256];
    double value = 0;
    snprintf(command, sizeof command, "getp %s", name);
    const char *const answer = talk_try(talk, command);
    if (!find_value(answer, &value))
        ck_abort_msg("%s: %s", command, answer);
    return value;
}

void talk_wait(struct talk *const talk, const char *const name, const double low, const double high)
{
    double value = 0;
    for (unsigned i = 0; i < WAIT_STEPS; i++) {
        value = talk_value(talk, name);
        if (value >= low && value <= high)
            return;
        usleep(STEP_US);
    }
    const size_t shown = talk->host.len < SHOWN_BYTES ? talk->host.len : SHOWN_BYTES;
    ck_abort_msg("%s stays at %g instead of %g to %g: ...%s", name, value, low, high,
                 talk->host.text + talk->host.len - shown);
}

void talk_wait_text(struct talk *const talk, const char *const text)
{
    for (unsigned i = 0; i < WAIT_STEPS; i++) {
        (void)talk_try(talk, "");
        if (strstr(talk->host.text, text))
            return;
        usleep(STEP_US);
    }
    ck_abort_msg("\"%s\" does not come: %s", text, talk->host.text);
}
