/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The flight recorder's files. Outside realtime. */
#ifndef FLIGHT_FILES_H
#define FLIGHT_FILES_H

#include <stdbool.h>
#include <stddef.h>

#include <hm2/board.h>

#define FLIGHT_FILES_MAX 20u /* of one card in a folder */

/* When the board's recorder has stopped, write folder/PREFIX-NUMBER.flight and let it record again. True when that
 * happened, or could not be done: text says which. */
bool flight_file_write(struct hm2_board *board, const char *folder, char *text, size_t size);

#endif
