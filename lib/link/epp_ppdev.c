/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* EPP cycles through the kernel's ppdev driver (ppmc.md section 10.1, with its traps). */
#include <errno.h>
#include <fcntl.h>
#include <linux/parport.h>
#include <linux/ppdev.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "epp.h"

#define NOT_SET (-1)

struct ppdev {
    struct epp base;
    int fd;
    bool claimed, reverse;
    int mode;      /* IEEE1284_... as the kernel has it */
    int direction; /* 1 = data lines are inputs */
};

static int set_mode(struct ppdev *const ppdev, int mode)
{
    if (ppdev->mode == mode)
        return 0;
    if (ioctl(ppdev->fd, PPSETMODE, &mode) != 0)
        return HM2_ERR_IO;
    ppdev->mode = mode;
    return 0;
}

static int set_direction(struct ppdev *const ppdev, int direction)
{
    if (!ppdev->reverse || ppdev->direction == direction)
        return 0;
    if (ioctl(ppdev->fd, PPDATADIR, &direction) != 0)
        return HM2_ERR_IO;
    ppdev->direction = direction;
    return 0;
}

/* The kernel checks the time-out bit behind every byte and stops short there, because no fast flag is set. */
static int move_bytes(struct ppdev *const ppdev, const struct epp_step *const step, struct epp_done *const done)
{
    const bool reads = epp_is_read(step->kind);
    const ssize_t moved = reads ? read(ppdev->fd, step->data, step->len) : write(ppdev->fd, step->data, step->len);
    if (moved == step->len)
        return 0;
    done->bytes = moved > 0 ? (size_t)moved : 0;
    return moved >= 0 || errno == EAGAIN || errno == EIO || errno == ETIMEDOUT ? HM2_ERR_TIMEOUT : HM2_ERR_IO;
}

static int run_step(struct ppdev *const ppdev, const struct epp_step *const step, struct epp_done *const done)
{
    const int mode = IEEE1284_MODE_EPP | (epp_is_address(step->kind) ? IEEE1284_ADDR : 0);
    int err = set_mode(ppdev, mode);
    if (err == 0)
        err = set_direction(ppdev, epp_is_read(step->kind));
    if (err == 0)
        err = move_bytes(ppdev, step, done);
    if (err == 0)
        done->steps++;
    return err;
}

static int ppdev_run(struct epp *const epp, const struct epp_step *const steps, const size_t count,
                     struct epp_done *const done)
{
    struct ppdev *const ppdev = (struct ppdev *)epp;
    int err = 0;
    *done = (struct epp_done){0};
    while (err == 0 && done->steps < count)
        err = run_step(ppdev, &steps[done->steps], done);
    return err;
}

/* ---- open and close ---------------------------------------------------------------------------------------------- */

static void ppdev_close(struct epp *const epp)
{
    struct ppdev *const ppdev = (struct ppdev *)epp;
    if (ppdev->claimed) {
        /* Closing in another mode makes the kernel end it with a pulse of nInit: a reset of all boards. */
        (void)set_mode(ppdev, IEEE1284_MODE_COMPAT);
        (void)ioctl(ppdev->fd, PPRELEASE);
    }
    if (ppdev->fd >= 0)
        (void)close(ppdev->fd);
    free(ppdev);
}

static int refuse(const char *const device, const char *const what, struct hm2_diag *const diag)
{
    return hm2_diag_add(diag, HM2_ERR_IO, "Bus %.64s: %s: %s.", device, what, strerror(errno));
}

static int claim(struct ppdev *const ppdev, const char *const device, struct hm2_diag *const diag)
{
    unsigned char control = PARPORT_CONTROL_INIT;
    int modes = 0;
    (void)ioctl(ppdev->fd, PPEXCL); /* refused where others are registered; then the claim tells */
    if (ioctl(ppdev->fd, PPCLAIM) != 0)
        return refuse(device, "the port cannot be claimed; remove what uses it (rmmod lp)", diag);
    ppdev->claimed = true;
    if (ioctl(ppdev->fd, PPGETMODES, &modes) != 0)
        return refuse(device, "its modes cannot be read", diag);
    if (!(modes & PARPORT_MODE_EPP))
        return hm2_diag_add(diag, HM2_ERR_UNSUPPORTED,
                            "Bus %.64s: the port has no EPP mode in hardware (modes 0x%X); choose EPP 1.9 in the "
                            "computer's firmware set-up, or use another card.",
                            device, (unsigned)modes);
    if (set_mode(ppdev, IEEE1284_MODE_EPP) != 0)
        return refuse(device, "EPP mode is refused", diag);
    /* The kernel's idle value holds nSelectIn, which boards take for an address strobe that never ends. */
    if (ioctl(ppdev->fd, PPWCONTROL, &control) != 0)
        return refuse(device, "the control lines cannot be set", diag);
    return 0;
}

int epp_ppdev_open(struct epp **const epp, const char *const device, const bool reverse, struct hm2_diag *const diag)
{
    static const struct epp_ops ops = {.run = ppdev_run, .now_ns = epp_monotonic_ns, .close = ppdev_close};
    struct ppdev *const ppdev = calloc(1, sizeof *ppdev);
    if (!ppdev)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "No memory for a parallel port.");
    *ppdev = (struct ppdev){.base.ops = &ops, .reverse = reverse, .mode = NOT_SET, .direction = NOT_SET};
    ppdev->fd = open(device, O_RDWR | O_NONBLOCK | O_CLOEXEC);
    int err;
    if (ppdev->fd < 0)
        err = refuse(device, "cannot be opened (is the module ppdev loaded, and are you in the group lp?)", diag);
    else
        err = claim(ppdev, device, diag);
    if (err) {
        ppdev_close(&ppdev->base);
        return err;
    }
    *epp = &ppdev->base;
    return 0;
}
