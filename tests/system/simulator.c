/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "simulator.h"

#include <arpa/inet.h>
#include <check.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#define READY_MS   20000
#define END_MS     10000
#define ANSWER_MS  10000
#define REPLY_MS   1000
#define READ_TRIES 5u
#define MAX_ARGS   32
#define CARD_PORT  27181

void simulator_start(struct simulator *const sim, const char *const *args)
{
    static char specs[SIMULATOR_CARDS][48];
    const char *argv[MAX_ARGS] = {process_built("hm2sim"), "--realtime", "--control", sim->control, "--bind",
                                  sim->address[0]};
    unsigned n = 6, cards = 0;
    snprintf(sim->control, sizeof sim->control, "/tmp/check-sim-%d", (int)getpid());
    for (unsigned i = 0; i < SIMULATOR_CARDS; i++)
        test_address(i, sim->address[i]);
    for (; args && *args; args++) {
        ck_assert_uint_lt(n + 2, MAX_ARGS);
        argv[n++] = *args;
        if (strcmp(*args, "--card") != 0)
            continue;
        ck_assert_uint_lt(cards, SIMULATOR_CARDS);
        snprintf(specs[cards], sizeof specs[cards], "%s@%s", *++args, sim->address[cards]);
        argv[n++] = specs[cards++];
    }
    argv[n] = NULL;
    process_start(&sim->process, argv);
    if (!process_wait_line(&sim->process, "ready ", READY_MS, NULL))
        ck_abort_msg("hm2sim is not ready: %s", sim->process.text);
}

void simulator_stop(struct simulator *const sim)
{
    const int status = process_stop(&sim->process, SIGTERM, END_MS);
    if (status != 0)
        ck_abort_msg("hm2sim ended with %d: %s", status, sim->process.text);
}

/* ---- commands ---------------------------------------------------------------------------------------------------- */

const char *simulator_ask(const struct simulator *const sim, const char *const command)
{
    static char answer[4096];
    struct sockaddr_un own = {.sun_family = AF_UNIX}, to = {.sun_family = AF_UNIX};
    snprintf(own.sun_path, sizeof own.sun_path, "/tmp/check-asks-%d", (int)getpid());
    memcpy(to.sun_path, sim->control, sizeof sim->control);
    unlink(own.sun_path);
    const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    ck_assert_int_eq(bind(fd, (const struct sockaddr *)&own, sizeof own), 0);
    ck_assert_int_ge(sendto(fd, command, strlen(command), 0, (const struct sockaddr *)&to, sizeof to), 0);
    struct pollfd p = {.fd = fd, .events = POLLIN};
    const ssize_t len = poll(&p, 1, ANSWER_MS) > 0 ? recv(fd, answer, sizeof answer - 1, 0) : -1;
    close(fd);
    unlink(own.sun_path);
    if (len < 0)
        ck_abort_msg("hm2sim does not answer \"%s\": %s", command, sim->process.text);
    answer[len] = '\0';
    return answer;
}

void simulator_do(const struct simulator *const sim, const char *const command)
{
    const char *const answer = simulator_ask(sim, command);
    if (strcmp(answer, "ok") != 0)
        ck_abort_msg("hm2sim: %s: %s", command, answer);
}

char simulator_pad(const struct simulator *const sim, const unsigned card, const unsigned io)
{
    char command[64];
    snprintf(command, sizeof command, "card %u pad %u", card, io);
    const char *const answer = simulator_ask(sim, command);
    if (strlen(answer) != 1)
        ck_abort_msg("hm2sim: %s: %s", command, answer);
    return answer[0];
}

/* ---- registers --------------------------------------------------------------------------------------------------- */

uint32_t simulator_read(const struct simulator *const sim, const unsigned card, const unsigned address)
{
    /* read one 32-bit word of HostMot2 space, with address */
    const uint8_t request[] = {0x01, 0x42, (uint8_t)address, (uint8_t)(address >> 8)};
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons(CARD_PORT)};
    uint8_t reply[64] = {0};
    ck_assert_int_eq(inet_pton(AF_INET, sim->address[card], &at.sin_addr), 1);
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    ck_assert_int_eq(connect(fd, (const struct sockaddr *)&at, sizeof at), 0);
    ssize_t len = -1;
    for (unsigned i = 0; i < READ_TRIES && len != 4; i++) {
        struct pollfd p = {.fd = fd, .events = POLLIN};
        ck_assert_int_eq(send(fd, request, sizeof request, 0), (ssize_t)sizeof request);
        len = poll(&p, 1, REPLY_MS) > 0 ? recv(fd, reply, sizeof reply, 0) : -1;
    }
    close(fd);
    ck_assert_int_eq(len, 4);
    return (uint32_t)reply[0] | (uint32_t)reply[1] << 8 | (uint32_t)reply[2] << 16 | (uint32_t)reply[3] << 24;
}

bool simulator_suits_linuxcnc(void)
{
    if (TEST_SANITIZED)
        printf("SKIP: LinuxCNC's own driver gives up on a card that a sanitizer slows down\n");
    return !TEST_SANITIZED;
}
