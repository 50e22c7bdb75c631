/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* An EPP bus by its name. */
#include "epp.h"

#include <string.h>
#include <time.h>

#define NS_PER_S   INT64_C(1000000000)
#define MAX_PORT   0xFFF8u /* eight registers from here */
#define MAX_DIGITS 4u

int64_t epp_monotonic_ns(struct epp *const epp)
{
    struct timespec now;
    (void)epp;
    (void)clock_gettime(CLOCK_MONOTONIC, &now); /* cannot fail for this clock */
    return (int64_t)now.tv_sec * NS_PER_S + now.tv_nsec;
}

static int digit(const char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    const char lower = (char)(c | 0x20);
    return lower >= 'a' && lower <= 'f' ? lower - 'a' + 10 : -1;
}

/* "0x378"; leaves *text behind it. */
static bool read_port(const char **const text, uint16_t *const port)
{
    unsigned value = 0, digits = 0;
    if (strncmp(*text, "0x", 2) != 0)
        return false;
    for (*text += 2; digit(**text) >= 0 && digits < MAX_DIGITS; (*text)++, digits++)
        value = value * 16u + (unsigned)digit(**text);
    *port = (uint16_t)value;
    return digits > 0 && value > 0 && value <= MAX_PORT;
}

static int open_port(struct epp **const epp, const char *const name, const bool reverse, struct hm2_diag *const diag)
{
    struct epp_port_options options = {.reverse = reverse};
    const char *at = name + strlen("port:");
    const bool good = read_port(&at, &options.base) && (*at != ':' || (at++, read_port(&at, &options.ecr_base)));
    if (!good || *at != '\0')
        return hm2_diag_add(diag, HM2_ERR_INVALID,
                            "Bus \"%.64s\": expected port:0xBASE or port:0xBASE:0xECRBASE with port numbers up to "
                            "0x%X, for example port:0x378:0x778.",
                            name, MAX_PORT);
    return epp_port_open(epp, &options, diag);
}

int epp_open(struct epp **const epp, const char *const name, const bool reverse, struct hm2_diag *const diag)
{
    if (strncmp(name, "/dev/", 5) == 0)
        return epp_ppdev_open(epp, name, reverse, diag);
    if (strncmp(name, "port:", 5) == 0)
        return open_port(epp, name, reverse, diag);
    if (strncmp(name, "sim:", 4) == 0)
        return epp_socket_open(epp, name + 4, EPP_SOCKET_WAIT_NS, diag);
    return hm2_diag_add(diag, HM2_ERR_INVALID,
                        "Bus \"%.64s\": expected /dev/parportN, port:0xBASE or sim:SOCKET, for example /dev/parport0.",
                        name);
}
