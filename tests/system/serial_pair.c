/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "serial_pair.h"

#include <check.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include "shared_memory.h"

#define FRAME_BYTES 512
#define QUIET_MS    5  /* a frame ends */
#define LOOK_MS     10 /* between looks at the fault */

struct frame {
    uint8_t bytes[FRAME_BYTES];
    size_t length;
};

/* Modbus over serial line, V1.02, 6.2.2 */
static uint16_t checksum(const uint8_t *const bytes, const size_t length)
{
    uint16_t crc = 0xFFFF;
    for (size_t i = 0; i < length; i++) {
        crc ^= bytes[i];
        for (unsigned bit = 0; bit < 8; bit++)
            crc = (uint16_t)(crc & 1u ? crc >> 1 ^ 0xA001u : crc >> 1);
    }
    return crc;
}

static void readdress(struct frame *const frame)
{
    if (frame->length < 4)
        return;
    frame->bytes[0] ^= 0x60u;
    const uint16_t crc = checksum(frame->bytes, frame->length - 2);
    frame->bytes[frame->length - 2] = (uint8_t)crc;
    frame->bytes[frame->length - 1] = (uint8_t)(crc >> 8);
}

static void take_frame(const int fd, struct frame *const frame)
{
    struct pollfd ready = {.fd = fd, .events = POLLIN};
    frame->length = 0;
    do {
        const ssize_t got = read(fd, frame->bytes + frame->length, sizeof frame->bytes - frame->length);
        frame->length += got > 0 ? (size_t)got : 0;
    } while (frame->length < sizeof frame->bytes && poll(&ready, 1, QUIET_MS) > 0);
}

static void pass(const int fd, const struct frame *const frame)
{
    if (write(fd, frame->bytes, frame->length) < 0)
        _exit(3);
}

static void pass_answer(const int fd, struct frame *const frame, const int fault)
{
    if (fault == WIRE_SPOILT)
        frame->bytes[frame->length - 1] ^= 0xFFu;
    if (fault == WIRE_CUT)
        frame->length--;
    if (fault == WIRE_OTHER_UNIT)
        readdress(frame);
    pass(fd, frame);
}

static void carry(struct wire *const wire, const int client, const int device)
{
    struct frame request, answer = {.length = 0};
    struct pollfd ready[2] = {{.fd = client, .events = POLLIN}, {.fd = device, .events = POLLIN}};
    for (;;) {
        (void)poll(ready, 2, LOOK_MS);
        const int fault = atomic_load(&wire->fault);
        if (ready[0].revents & POLLIN) {
            take_frame(client, &request);
            atomic_store(&wire->kept, 0);
            atomic_fetch_add(&wire->requests, 1);
            if (fault != WIRE_OPEN)
                pass(device, &request);
        }
        if (atomic_load(&wire->kept) && fault != WIRE_HELD) {
            atomic_fetch_add(&wire->late, 1);
            atomic_store(&wire->kept, 0);
            pass(client, &answer);
        }
        if (ready[1].revents & POLLIN) {
            take_frame(device, &answer);
            atomic_fetch_add(&wire->answers, 1);
            if (fault == WIRE_HELD)
                atomic_store(&wire->kept, 1);
            else
                pass_answer(client, &answer, fault);
        }
    }
}

/* Both ends stay open here, so that no process sees the other's end as a hang-up. */
static void open_end(char path[const 64], int *const master, int *const slave)
{
    struct termios raw;
    *master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    ck_assert_int_ge(*master, 0);
    ck_assert(grantpt(*master) == 0 && unlockpt(*master) == 0);
    ck_assert_int_eq(ptsname_r(*master, path, 64), 0);
    *slave = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC);
    ck_assert(*slave >= 0 && tcgetattr(*slave, &raw) == 0);
    cfmakeraw(&raw);
    ck_assert_int_eq(tcsetattr(*slave, TCSANOW, &raw), 0);
    ck_assert_int_eq(chmod(path, 0666), 0);
}

void serial_pair_open(struct serial_pair *const pair)
{
    open_end(pair->client, &pair->fds[0], &pair->fds[1]);
    open_end(pair->device, &pair->fds[2], &pair->fds[3]);
    pair->wire = shared_memory(sizeof *pair->wire);
    (void)fflush(NULL);
    pair->process = fork();
    ck_assert_int_ge(pair->process, 0);
    if (pair->process == 0) {
        (void)prctl(PR_SET_PDEATHSIG, SIGKILL);
        carry(pair->wire, pair->fds[0], pair->fds[2]);
    }
}

void serial_pair_close(struct serial_pair *const pair)
{
    (void)kill(pair->process, SIGKILL);
    (void)waitpid(pair->process, NULL, 0);
    (void)munmap(pair->wire, sizeof *pair->wire);
    for (unsigned i = 0; i < 4; i++)
        (void)close(pair->fds[i]);
}
