/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "process.h"

#include <check.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define MS_PER_S        1000
#define NS_PER_MS       1000000
#define POLL_SLICE_MS   20
#define EXEC_FAILED     127
#define KILLED_LIMIT_MS 5000

static int64_t now_ms(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * MS_PER_S + now.tv_nsec / NS_PER_MS;
}

static void become(const char *const *const argv, const int input, const int output, const pid_t parent)
{
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent)
        _exit(EXEC_FAILED); /* the test is gone already */
    dup2(output, STDOUT_FILENO);
    dup2(output, STDERR_FILENO);
    const int from = input >= 0 ? input : open("/dev/null", O_RDONLY);
    if (from >= 0)
        dup2(from, STDIN_FILENO);
    execvp(argv[0], (char *const *)(uintptr_t)argv); /* execvp does not write through it (POSIX) */
    dprintf(STDERR_FILENO, "%s: %s\n", argv[0], strerror(errno));
    _exit(EXEC_FAILED);
}

static void start(struct process *const process, const char *const *const argv, const bool listening)
{
    int ends[2], input[2] = {-1, -1};
    const pid_t parent = getpid();
    if (pipe2(ends, O_CLOEXEC) || (listening && pipe2(input, O_CLOEXEC)))
        ck_abort_msg("no pipe: %s", strerror(errno));
    process->input = input[1];
    process->output = ends[0];
    process->len = 0;
    process->text[0] = '\0';
    process->ended = false;
    process->pid = fork();
    if (process->pid < 0)
        ck_abort_msg("cannot start %s: %s", argv[0], strerror(errno));
    if (process->pid == 0)
        become(argv, input[0], ends[1], parent);
    close(ends[1]);
    if (listening)
        close(input[0]);
}

void process_start(struct process *const process, const char *const *const argv)
{
    start(process, argv, false);
}

void process_start_listening(struct process *const process, const char *const *const argv)
{
    signal(SIGPIPE, SIG_IGN); /* one that has ended is noticed when its answer is waited for */
    start(process, argv, true);
}

void process_say(const struct process *const process, const char *const text)
{
    size_t done = 0;
    const size_t len = strlen(text);
    while (done < len) {
        const ssize_t written = write(process->input, text + done, len - done);
        if (written < 0)
            return;
        done += (size_t)written;
    }
}

void process_hush(struct process *const process)
{
    if (process->input >= 0)
        close(process->input);
    process->input = -1;
}

static void reap(struct process *const process, const int options)
{
    int status;
    if (process->ended || wait4(process->pid, &status, options, &process->usage) != process->pid)
        return;
    process->ended = true;
    process->status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

/* Take what it printed, waiting at most limit_ms for something. False when the pipe is closed. */
static bool take_output(struct process *const process, const int limit_ms)
{
    char rest[4096];
    struct pollfd poll_fd = {.fd = process->output, .events = POLLIN};
    if (process->output < 0)
        return false;
    if (poll(&poll_fd, 1, limit_ms) <= 0)
        return true;
    const size_t room = sizeof process->text - 1 - process->len;
    const ssize_t got =
        room > 0 ? read(process->output, process->text + process->len, room) : read(process->output, rest, sizeof rest);
    if (got <= 0) {
        close(process->output);
        process->output = -1;
        return false;
    }
    process->len += room > 0 ? (size_t)got : 0;
    process->text[process->len] = '\0';
    return true;
}

static const char *find_line(const struct process *const process, const char *const start)
{
    const size_t start_len = strlen(start);
    for (const char *line = process->text; *line;) {
        const char *const end = strchr(line, '\n');
        if (end && strncmp(line, start, start_len) == 0)
            return line;
        if (!end)
            return NULL;
        line = end + 1;
    }
    return NULL;
}

bool process_wait_line(struct process *const process, const char *const start, const int limit_ms,
                       const char **const line)
{
    const int64_t end_ms = now_ms() + limit_ms;
    for (;;) {
        const char *const found = find_line(process, start);
        if (found) {
            if (line)
                *line = found;
            return true;
        }
        if (now_ms() >= end_ms || !take_output(process, POLL_SLICE_MS))
            return false;
    }
}

bool process_started_or_skipped(struct process *const process, const char *const *const argv, const char *const start,
                                const int limit_ms)
{
    process_start(process, argv);
    if (process_wait_line(process, start, limit_ms, NULL))
        return true;
    printf("%s", process->text);
    ck_assert_int_eq(process->status, 77);
    return false;
}

bool process_wait_end(struct process *const process, const int limit_ms)
{
    const int64_t end_ms = now_ms() + limit_ms;
    while (now_ms() < end_ms) {
        if (!take_output(process, POLL_SLICE_MS))
            usleep(NS_PER_MS / 1000);
        reap(process, WNOHANG);
        if (process->ended) {
            while (take_output(process, 0) && process->output >= 0 &&
                   poll(&(struct pollfd){.fd = process->output, .events = POLLIN}, 1, 0) > 0) {
            }
            return true;
        }
    }
    return false;
}

int process_stop(struct process *const process, const int signal, const int limit_ms)
{
    if (!process->ended)
        kill(process->pid, signal);
    if (!process_wait_end(process, limit_ms)) {
        kill(process->pid, SIGKILL);
        if (!process_wait_end(process, KILLED_LIMIT_MS))
            ck_abort_msg("process %d cannot be killed", (int)process->pid);
    }
    process_hush(process);
    if (process->output >= 0)
        close(process->output);
    process->output = -1;
    return process->status;
}

int process_run(struct process *const process, const char *const *const argv, const int limit_ms)
{
    process_start(process, argv);
    if (!process_wait_end(process, limit_ms))
        return process_stop(process, SIGKILL, KILLED_LIMIT_MS);
    return process_stop(process, SIGKILL, 0);
}

void process_give_up(const struct process *const process, const char *const what)
{
    printf("%s\n", process->text);
    fflush(stdout);
    ck_abort_msg("%s, status %d", what, process->status);
}

const char *process_find(const char *const program)
{
    static char found[512];
    const char *path = getenv("PATH");
    while (path && *path) {
        const size_t len = strcspn(path, ":");
        snprintf(found, sizeof found, "%.*s/%s", (int)len, path, program);
        if (access(found, X_OK) == 0)
            return found;
        path += len + (path[len] == ':');
    }
    return NULL;
}

const char *process_built(const char *const name)
{
    static char paths[4][512];
    static unsigned next;
    char *const path = paths[next++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", TEST_BUILD, name);
    return path;
}

void test_address(const unsigned index, char text[const 16])
{
    const unsigned number = (unsigned)getpid() * 64u + index % 64u;
    snprintf(text, 16, "127.%u.%u.%u", 1 + (number >> 16) % 254, number >> 8 & 0xFFu, number & 0xFFu);
}
