/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The speed of a terminal, in both directions. */
#ifndef HM2_PTY_SPEED_H
#define HM2_PTY_SPEED_H

#include <stdint.h>

/* Bits a second, any number; 0 when the terminal does not tell. */
uint32_t terminal_speed(int fd);
/* 0, or -1 with errno. */
int terminal_set_speed(int fd, uint32_t baud);

#endif
