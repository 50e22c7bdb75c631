/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Inside of a board: shared by the files of lib/board and their tests. */
#ifndef BOARD_PRIVATE_H
#define BOARD_PRIVATE_H

#include <stdatomic.h>

#include <hm2/board.h>
#include <hm2/module.h>

#include "notice.h"

struct hm2_board {
    struct board_notices notices;
};

#endif
