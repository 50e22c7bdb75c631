/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "serial.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

static int open_pair(struct serial *const s, char path[128])
{
    struct termios raw;
    s->fd = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
    if (s->fd < 0 || grantpt(s->fd) || unlockpt(s->fd) || ptsname_r(s->fd, path, 128))
        return HM2_ERR_IO;
    s->far_fd = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (s->far_fd < 0 || tcgetattr(s->far_fd, &raw))
        return HM2_ERR_IO;
    cfmakeraw(&raw);
    return tcsetattr(s->far_fd, TCSANOW, &raw) ? HM2_ERR_IO : 0;
}

/* A link that an earlier run left is replaced, and nothing else. */
static int name_it(struct serial *const s, const char *const path)
{
    struct stat there;
    if (lstat(s->option->path, &there) == 0 && S_ISLNK(there.st_mode))
        unlink(s->option->path);
    if (symlink(path, s->option->path))
        return HM2_ERR_IO;
    s->linked = true;
    return 0;
}

int serial_open(struct serial *const s, const struct serial_option *const option, const uint32_t number,
                struct hm2_diag *const diag)
{
    char path[128];
    *s = (struct serial){.option = option, .fd = -1, .far_fd = -1};
    const int err = remote_new(&s->remote, option->remote, number, diag);
    if (err)
        return err;
    remote_lbp_init(&s->line, s->remote, LBP_SETUP_BAUD);
    if (open_pair(s, path))
        return hm2_diag_add(diag, HM2_ERR_IO, "no pseudo-terminal for %s: %s", option->remote, strerror(errno));
    if (name_it(s, path))
        return hm2_diag_add(diag, HM2_ERR_IO, "%s: %s", option->path, strerror(errno));
    return 0;
}

void serial_close(struct serial *const s)
{
    if (s->linked)
        unlink(s->option->path);
    if (s->far_fd >= 0)
        close(s->far_fd);
    if (s->fd >= 0)
        close(s->fd);
    remote_free(s->remote);
}

void serial_receive(struct serial *const s, const int64_t now_ns)
{
    uint8_t bytes[512], answer[LBP_MESSAGE_BYTES];
    const ssize_t count = read(s->fd, bytes, sizeof bytes);
    for (ssize_t i = 0; i < count; i++) {
        const size_t len = remote_lbp_take(&s->line, bytes[i], now_ns, answer);
        if (len > 0)
            (void)!write(s->fd, answer, len); /* a client that does not read loses it, as on a line */
    }
}
