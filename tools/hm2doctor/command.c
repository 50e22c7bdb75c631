/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "command.h"

#include <errno.h>
#include <fcntl.h>
#include <spawn.h>
#include <stdbool.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#define COMMAND_BYTES 1024u

extern char **environ;

/* All of it, also what does not fit: the program must not fail for that. */
static void read_all(const int from, char *const output, const size_t cap)
{
    char rest[512] = "";
    size_t len = 0;
    for (;;) {
        const bool fits = len + 1 < cap;
        const ssize_t got = read(from, fits ? output + len : rest, fits ? cap - 1 - len : sizeof rest);
        if (got == 0 || (got < 0 && errno != EINTR))
            break;
        if (got > 0 && fits)
            len += (size_t)got;
    }
    output[len] = '\0';
}

static int wait_for(const pid_t child)
{
    int status;
    while (waitpid(child, &status, 0) < 0) {
        if (errno != EINTR)
            return -1;
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

static int start(const char *const line, const int out, pid_t *const child)
{
    char copy[COMMAND_BYTES];
    char *const argv[] = {(char[]){"sh"}, (char[]){"-c"}, copy, NULL};
    const size_t len = strlen(line);
    if (len >= sizeof copy)
        return E2BIG;
    memcpy(copy, line, len + 1);
    posix_spawn_file_actions_t actions;
    int err = posix_spawn_file_actions_init(&actions);
    if (err)
        return err;
    if (out >= 0)
        err = posix_spawn_file_actions_adddup2(&actions, out, STDOUT_FILENO);
    if (out >= 0 && !err)
        err = posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    if (!err)
        err = posix_spawn(child, "/bin/sh", &actions, NULL, argv, environ);
    posix_spawn_file_actions_destroy(&actions);
    return err;
}

int command_run(const char *const line, char *const output, const size_t cap)
{
    int ends[2] = {-1, -1};
    pid_t child;
    if (output && pipe2(ends, O_CLOEXEC) != 0)
        return -1;
    const int err = start(line, ends[1], &child);
    if (output) {
        close(ends[1]);
        if (!err)
            read_all(ends[0], output, cap);
        close(ends[0]);
    }
    return err ? -1 : wait_for(child);
}
