/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Apart from the rest: these headers and <termios.h> do not go together, and only these tell a speed as a number. */
#include "speed.h"

#include <asm/termbits.h>
#include <stddef.h>
#include <sys/ioctl.h>

/* Programs that know these alone would not understand another name for the same speed. */
static const struct {
    uint32_t baud;
    tcflag_t name;
} usual[] = {
    {300, B300},         {600, B600},         {1200, B1200},       {2400, B2400},       {4800, B4800},
    {9600, B9600},       {19200, B19200},     {38400, B38400},     {57600, B57600},     {115200, B115200},
    {230400, B230400},   {460800, B460800},   {500000, B500000},   {576000, B576000},   {921600, B921600},
    {1000000, B1000000}, {1152000, B1152000}, {1500000, B1500000}, {2000000, B2000000}, {2500000, B2500000},
    {3000000, B3000000}, {3500000, B3500000}, {4000000, B4000000},
};

static tcflag_t name_of(const uint32_t baud)
{
    for (size_t i = 0; i < sizeof usual / sizeof usual[0]; i++)
        if (usual[i].baud == baud)
            return usual[i].name;
    return BOTHER;
}

uint32_t terminal_speed(const int fd)
{
    struct termios2 settings;
    return ioctl(fd, TCGETS2, &settings) ? 0 : settings.c_ospeed;
}

int terminal_set_speed(const int fd, const uint32_t baud)
{
    struct termios2 settings;
    if (ioctl(fd, TCGETS2, &settings))
        return -1;
    settings.c_cflag = (settings.c_cflag & ~(tcflag_t)(CBAUD | CBAUD << IBSHIFT)) | name_of(baud);
    settings.c_ispeed = settings.c_ospeed = baud;
    return ioctl(fd, TCSETS2, &settings);
}
