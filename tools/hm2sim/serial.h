/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Remotes on pseudo-terminals, in set-up mode. */
#ifndef HM2SIM_SERIAL_H
#define HM2SIM_SERIAL_H

#include "options.h"
#include "remote_lbp.h"

struct serial {
    const struct serial_option *option;
    struct remote *remote;
    struct remote_lbp line;
    int fd;     /* the remote's end, -1 = not open */
    int far_fd; /* held open, so that clients may come and go */
    bool linked;
};

int HM2_MUST_CHECK serial_open(struct serial *serial, const struct serial_option *option, uint32_t number,
                               struct hm2_diag *diag);
void serial_close(struct serial *serial);
/* Take what has arrived, and answer. */
void serial_receive(struct serial *serial, int64_t now_ns);

#endif
