/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The CAN controller behind an interface: its state, and bringing it back after bus-off, by netlink (libsocketcan).
 * That takes system calls which wait, so it is for the thread beside the cycle. Restarting needs CAP_NET_ADMIN.
 */
#ifndef CAN_IO_CONTROLLER_H
#define CAN_IO_CONTROLLER_H

#include <stdbool.h>

enum controller_state { /* as the kernel numbers them */
                        CONTROLLER_ACTIVE,
                        CONTROLLER_WARNING,
                        CONTROLLER_PASSIVE,
                        CONTROLLER_BUS_OFF,
                        CONTROLLER_STOPPED,
                        CONTROLLER_SLEEPING,
                        CONTROLLER_UNKNOWN, /* there is none, as behind vcan, or nobody to ask */
};

enum controller_state controller_state(const char *interface);
/* 0, or -1 when the kernel did not do it, as when the controller is not bus-off. */
int controller_restart(const char *interface);
/* Whether the interface is up and has a carrier. */
bool controller_link_up(const char *interface);

#endif
