/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "controller.h"

#include <net/if.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#ifdef HM2_HAVE_SOCKETCAN
#include <libsocketcan.h>

enum controller_state controller_state(const char *const interface)
{
    int state = CONTROLLER_UNKNOWN;
    if (can_get_state(interface, &state) != 0 || state < 0 || state > CONTROLLER_UNKNOWN)
        return CONTROLLER_UNKNOWN;
    return (enum controller_state)state;
}

int controller_restart(const char *const interface)
{
    __u32 restart_ms = 0;
    if (can_do_restart(interface) == 0)
        return 0;
    /* Some drivers cannot; stopped and started, their controller begins anew, too. With restart-ms the kernel does it.
     */
    if (controller_state(interface) != CONTROLLER_BUS_OFF || can_get_restart_ms(interface, &restart_ms) != 0 ||
        restart_ms != 0 || can_do_stop(interface) != 0)
        return -1;
    return can_do_start(interface);
}
#else
enum controller_state controller_state(const char *const interface)
{
    (void)interface;
    return CONTROLLER_UNKNOWN;
}

int controller_restart(const char *const interface)
{
    (void)interface;
    return -1;
}
#endif

bool controller_link_up(const char *const interface)
{
    struct ifreq request = {0};
    if (strlen(interface) >= sizeof request.ifr_name)
        return false;
    memcpy(request.ifr_name, interface, strlen(interface));
    const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return false;
    const int result = ioctl(fd, SIOCGIFFLAGS, &request);
    close(fd);
    return result == 0 && (request.ifr_flags & IFF_UP) != 0 && (request.ifr_flags & IFF_RUNNING) != 0;
}
