/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "cli.h"

int do_sserial(struct cli *const cli, const char *const arg)
{
    (void)arg;
    return complain(cli, REFUSED, "not here");
}
