/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A card that lost its power or was loaded anew has forgotten the session number in its scratch registers. It is asked
 * who it is before anything else; with the firmware that was set up everything is sent again, with all outputs off,
 * and a person clears has_bit. With any other firmware nothing more is sent.
 */
#include <hm2/bytes.h>

#include "../module/watchdog.h"
#include "board_private.h"

#define RECENT_CYCLES 10u

/* A write that is overdue right now counts too. */
int64_t board_write_gap_ns(const struct hm2_board *const board)
{
    const int64_t open_ns = board->writes > 0 ? board->notices.now_ns - board->write_ns : 0;
    return open_ns > board->write_gap_ns ? open_ns : board->write_gap_ns;
}

enum board_bite_reason board_bite_reason(const struct hm2_board *const board)
{
    if (board->lossy && board->cycles - board->last_loss_cycle <= RECENT_CYCLES)
        return BOARD_BITE_PACKET_LOSS;
    return board_write_gap_ns(board) > board->period_ns * 3 / 2 ? BOARD_BITE_LATE_WRITE : BOARD_BITE_UNKNOWN;
}

void board_recovery_begin(struct hm2_board *const board)
{
    board->recovery = BOARD_ASKS_IDENTITY;
    board_pipeline_stop(board);
    board_event(board, BOARD_EVENT_POWER_LOSS, &(struct board_event){.instance = 0});
}

const uint8_t *board_recovery_request(struct hm2_board *const board)
{
    struct board_exchange *const identity = &board->identity;
    identity->nonce = ++board->nonce | BOARD_NONCE_BIT;
    hm2_put_le32(identity->request + identity->nonce_at, identity->nonce);
    return identity->request;
}

static void refuse(struct hm2_board *const board, const struct hm2_image *const found)
{
    const uint64_t fingerprint = hm2_image_fingerprint(found);
    const struct board_event facts = {
        .words =
            {
                [BOARD_FOREIGN_CONFIG] = found->id[1],
                [BOARD_FOREIGN_CONFIG + 1] = found->id[2],
                [BOARD_FOREIGN_BOARD] = found->rom[3],
                [BOARD_FOREIGN_BOARD + 1] = found->rom[4],
                [BOARD_FOREIGN_FINGERPRINT] = (uint32_t)fingerprint,
                [BOARD_FOREIGN_FINGERPRINT + 1] = (uint32_t)(fingerprint >> 32),
            },
    };
    board->foreign = true;
    *board->points->io_error = true;
    board_event(board, BOARD_EVENT_FOREIGN_FIRMWARE, &facts);
}

void board_recovery_identified(struct hm2_board *const board)
{
    struct hm2_image found;
    board_image_take(board->identity.reply, &board->identity_at, &found);
    if (hm2_image_fingerprint(&found) != board->idrom.fingerprint) {
        refuse(board, &found);
        return;
    }
    board->foreign = false;
    board->recovery = BOARD_RESTORES;
    board->writes = 0;
    hm2_plan_touch_all(board->plan);
    hm2_watchdog_raise(board->watchdog);
}

void board_recovery_end(struct hm2_board *const board)
{
    board->recovery = BOARD_NORMAL;
    board_start_modules(board);
    *board->points->position_lost = true;
    /* Without a watchdog there is no has_bit for a person to clear before outputs come back. */
    if (!board->watchdog)
        *board->points->io_error = true;
    board_event(board, BOARD_EVENT_RESTORED, &(struct board_event){.instance = 0});
}
