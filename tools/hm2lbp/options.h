/* SPDX-License-Identifier: GPL-2.0-or-later */
#ifndef HM2LBP_OPTIONS_H
#define HM2LBP_OPTIONS_H

#include <stdbool.h>
#include <stdint.h>

#include <hm2/err.h>

enum { EXIT_FAILED = 1, EXIT_USAGE = 2, EXIT_REFUSED = 3, EXIT_NO_CONTACT = 4 };

struct options {
    const char *tty, *card; /* one of them */
    uint32_t baud;
    unsigned port, channel, mode;
    bool json, hex, yes, any_image;
    const char *const *words; /* command and its arguments */
    unsigned count;
};

enum options_result { OPTIONS_RUN, OPTIONS_EXIT_OK, OPTIONS_EXIT_USAGE };

/* Reads environment and command line; help, version and complaints have been printed when the result is not
 * OPTIONS_RUN. */
enum options_result options_read(struct options *options, int argc, char **argv);

#endif
