/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What happened, as sentences for people. Runs outside the cycle; the events come through the ring (notice.h). */
#include <stdio.h>
#include <string.h>

#include <hm2/bytes.h>

#include "board_private.h"

struct text {
    char *at;
    size_t size;
    const struct hm2_board *board;
};

#define SAY(text, ...) ((void)snprintf((text)->at, (text)->size, __VA_ARGS__))

/* ---- conditions of modules ----------------------------------------------------------------------------------------
 */

struct notice_text {
    const char *before, *after; /* around the value */
    bool error;
};

static const struct notice_text notice_texts[HM2_NOTICES] = {
    [HM2_NOTICE_WATCHDOG_BIT] = {NULL, NULL, true},
    [HM2_NOTICE_VALUE_CLAMPED] = {"the value ", " is out of range and was replaced by the nearest possible one", true},
    [HM2_NOTICE_VALUE_INVALID] = {"the value ", " is impossible; a safe one is used instead", true},
    [HM2_NOTICE_QUAD_ERROR] = {"quadrature error: both inputs changed at once (count ",
                               "); check encoder cables and screens, or switch the filter on", true},
    [HM2_NOTICE_TIMEOUT_SHORT] = {"the time-out of ",
                                  " ns is shorter than one and a half thread periods: a single late "
                                  "write will make the watchdog bite",
                                  false},
    [HM2_NOTICE_TABLE_TOO_LONG] = {"the step table (",
                                   ") is longer than 16 entries or wider than the pins; step and "
                                   "direction are used instead",
                                   true},
    [HM2_NOTICE_HEADROOM] = {"the command asks for ", ", which maxvel or maxaccel does not allow; the axis lags behind",
                             false},
    [HM2_NOTICE_DUMP_STATE] = {NULL, NULL, false},
    [HM2_NOTICE_REMOTE_LOST] = {"the remote on channel ",
                                " does not answer any more and is stopped, its inputs keep their last values; check "
                                "its power and cable, then set run to 0 and to 1",
                                true},
    [HM2_NOTICE_REMOTE_NOT_STARTED] = {"the remote on channel ",
                                       " did not start; check its power and cable, then set run to 0 and to 1", true},
    [HM2_NOTICE_REMOTE_OTHER] = {"another remote than at load answers on channel ",
                                 "; it is not driven. Load the component anew for it", true},
    [HM2_NOTICE_REMOTE_BACK] = {"the remote on channel ", " is back and is driven again", false},
    [HM2_NOTICE_REMOTE_FAULT] = {"the remote reports faults, bits ",
                                 " (1 watchdog, 2 not enabled, 4 over-temperature, 8 over-current, 16 over-voltage, 32 "
                                 "low voltage, 64 illegal mode, 128 LBP)",
                                 true},
    [HM2_NOTICE_PORT_STOPPED] = {"the port is stopped after ",
                                 " restarts by itself; check the remotes, then set run to 0 and to 1", true},
    [HM2_NOTICE_PORT_LATE] = {"a transfer of ",
                              " us was not finished in its cycle and the next was skipped; the thread is too fast for "
                              "these remotes, or the function .read is not in it",
                              false},
    [HM2_NOTICE_PARAMETER_REFUSED] = {"the remote on channel ", " did not take a parameter", true},
};

static void say_bite(const struct text *const text, const struct board_event *const event)
{
    const uint32_t *const words = event->words;
    const char *const prefix = text->board->prefix;
    static const char recover[] = "All outputs are off; when the cause is removed set watchdog.has_bit to 0";
    switch ((enum board_bite_reason)words[BOARD_BITE_REASON]) {
    case BOARD_BITE_PACKET_LOSS:
        SAY(text, "%s: the watchdog has bitten. Reason: packets were lost. %s", prefix, recover);
        return;
    case BOARD_BITE_LATE_WRITE:
        SAY(text,
            "%s: the watchdog has bitten. Reason: late write, %u us between two writes at a period of %u us (the "
            "thread "
            "was held up). %s",
            prefix, (unsigned)words[BOARD_BITE_GAP_US], (unsigned)words[BOARD_BITE_PERIOD_US], recover);
        return;
    case BOARD_BITE_UNKNOWN:
        break;
    }
    SAY(text, "%s: the watchdog has bitten. Reason: unknown, no packet was lost and no write was late. %s", prefix,
        recover);
}

static void say_state(const struct text *const text)
{
    const struct hm2_board *const board = text->board;
    size_t used = (size_t)snprintf(text->at, text->size, "%s: %s, %u modules:", board->prefix, board->card_name,
                                   board->module_count);
    for (unsigned i = 0; i < board->module_count && used < text->size; i++)
        used += (size_t)snprintf(text->at + used, text->size - used, " %s*%u", board->modules[i].type->name,
                                 board->modules[i].instances);
}

/* "hm2_7i96s.0.inm.00.scan_rate" */
static void put_subject(char *const name, const size_t size, const char *const prefix,
                        const struct board_event *const event)
{
    char instance[16] = "";
    if (event->instance != HM2_NO_INSTANCE)
        (void)snprintf(instance, sizeof instance, ".%02u", event->instance);
    (void)snprintf(name, size, "%s.%s%s%s%s", prefix, event->module->type->name, instance, event->point ? "." : "",
                   event->point ? event->point : "");
}

static bool say_notice(const struct text *const text, const struct board_event *const event)
{
    const struct notice_text *const row =
        &notice_texts[(unsigned)event->kind < HM2_NOTICES ? event->kind : HM2_NOTICE_VALUE_INVALID];
    char subject[HM2_NAME_SIZE];
    put_subject(subject, sizeof subject, text->board->prefix, event);
    if (event->kind == HM2_NOTICE_WATCHDOG_BIT)
        say_bite(text, event);
    else if (event->kind == HM2_NOTICE_DUMP_STATE)
        say_state(text);
    else
        SAY(text, "%s: %s%.9g%s", subject, row->before, event->value, row->after);
    return row->error;
}

/* ---- conditions of the board --------------------------------------------------------------------------------------
 */

static void say_errors(const struct text *const text, const char *const what, const uint32_t *const words,
                       const char *const then)
{
    SAY(text,
        "%s: %s: %u failed cycles so far (no reply in time %u, late %u, repeated %u, malformed %u, writes lost %u, "
        "sends "
        "refused %u). %s",
        text->board->prefix, what, (unsigned)words[BOARD_ERROR_TOTAL], (unsigned)words[BOARD_ERROR_LOST],
        (unsigned)words[BOARD_ERROR_LATE], (unsigned)words[BOARD_ERROR_STALE], (unsigned)words[BOARD_ERROR_MALFORMED],
        (unsigned)words[BOARD_ERROR_WRITE_LOST], (unsigned)words[BOARD_ERROR_SEND], then);
}

static const char remedies[] =
    "Check the card's power and cable; switch off interrupt coalescing (ethtool -C IF rx-usecs 0) and energy-efficient "
    "Ethernet (ethtool --set-eee IF eee off), give the network interrupt its own core, or raise packet-read-timeout";
static const char clear_it[] =
    "io_error is set: nothing is sent and the watchdog stops the outputs. Check the card's power and cable, then set "
    "io_error to 0 and watchdog.has_bit to 0";

static void put_text(char text[9], const uint32_t *const words)
{
    hm2_put_le32((uint8_t *)text, words[0]);
    hm2_put_le32((uint8_t *)text + 4, words[1]);
    for (unsigned i = 0; i < 8; i++)
        if (text[i] < ' ' || text[i] > '~')
            text[i] = '?';
    text[8] = '\0';
}

static void say_foreign(const struct text *const text, const uint32_t *const words)
{
    const struct hm2_board *const board = text->board;
    char config[9], name[9], expected[9];
    put_text(config, words + BOARD_FOREIGN_CONFIG);
    put_text(name, words + BOARD_FOREIGN_BOARD);
    put_text(expected, board->image.id + 1);
    SAY(text,
        "%s: the card came back with other firmware: config name \"%s\", board \"%s\", fingerprint %08X%08X found, "
        "expected \"%s\", \"%s\", %08X%08X. io_error is set and nothing is sent; program the right firmware, or load "
        "the component anew for this one",
        board->prefix, config, name, (unsigned)words[BOARD_FOREIGN_FINGERPRINT + 1],
        (unsigned)words[BOARD_FOREIGN_FINGERPRINT], expected, board->idrom.board_name,
        (unsigned)(board->idrom.fingerprint >> 32), (unsigned)board->idrom.fingerprint);
}

static void say_pipeline(const struct text *const text, const char *const what, const uint32_t *const words)
{
    SAY(text,
        "%s: %s. Of a period of %u us the thread needs up to %u us until it writes, the card waits up to %u us, "
        "packets are on their way for %u us; so far %u replies were late, %u were read before transfers were over",
        text->board->prefix, what, (unsigned)words[BOARD_PIPELINE_PERIOD_US], (unsigned)words[BOARD_PIPELINE_WORK_US],
        (unsigned)words[BOARD_PIPELINE_WAIT_US], (unsigned)words[BOARD_PIPELINE_RTT_US],
        (unsigned)words[BOARD_PIPELINE_LATE], (unsigned)words[BOARD_PIPELINE_EARLY]);
}

static void say_no_time(const struct text *const text, const uint32_t *const words)
{
    SAY(text,
        "%s: plain cycles: transfers of smart serial or SPI may take %u us, but the DPLL's timer fires %u us behind "
        "the write; set dpll.%02u.timer-us to more",
        text->board->prefix, (unsigned)words[BOARD_PIPELINE_NEED_US], (unsigned)words[BOARD_PIPELINE_TIMER_US],
        text->board->pipeline.timer);
}

static bool say_event(const struct text *const text, const struct board_event *const event)
{
    const char *const prefix = text->board->prefix;
    switch ((enum board_event_kind)event->kind) {
    case BOARD_EVENT_PACKET_ERROR:
        say_errors(text, "packet error", event->words, remedies);
        return false;
    case BOARD_EVENT_EXCEEDED:
        say_errors(text, "error finishing read", event->words, clear_it);
        return true;
    case BOARD_EVENT_POWER_LOSS:
        SAY(text,
            "%s: the card has lost its state (its power failed, or its firmware was loaded again). It is identified "
            "and "
            "set up again with all outputs off",
            prefix);
        return true;
    case BOARD_EVENT_RESTORED:
        SAY(text,
            "%s: the card is back with the same firmware. Positions may be lost: home again after setting %s to 0",
            prefix, text->board->watchdog ? "watchdog.has_bit" : "io_error");
        return true;
    case BOARD_EVENT_FOREIGN_FIRMWARE:
        say_foreign(text, event->words);
        return true;
    case BOARD_EVENT_PIPELINE_RUNS:
        say_pipeline(text, "the cycle is pipelined now", event->words);
        return false;
    case BOARD_EVENT_PIPELINE_FALLS:
        say_pipeline(text,
                     "too many replies came late, or before transfers were over: plain cycles again, the pipelined one "
                     "is tried again "
                     "later",
                     event->words);
        return false;
    case BOARD_EVENT_PIPELINE_NO_ROOM:
        say_pipeline(
            text,
            "plain cycles: the pipelined one has no room, or the DPLL timer's offset is not between 1 us and a "
            "third of the period",
            event->words);
        return false;
    case BOARD_EVENT_PIPELINE_NO_TIME:
        say_no_time(text, event->words);
        return false;
    case BOARD_EVENTS:
        break;
    }
    return false;
}

int hm2_board_next_message(struct hm2_board *const board, char *const text, const size_t size, bool *const error)
{
    const struct text out = {text, size, board};
    struct board_event event;
    if (board_notices_pop(&board->notices, &event)) {
        *error = event.module ? say_notice(&out, &event) : say_event(&out, &event);
        return 1;
    }
    const uint32_t overflows = atomic_load_explicit(&board->notices.overflows, memory_order_relaxed);
    if (overflows == board->overflows_told)
        return 0;
    SAY(&out, "%s: %u messages were dropped because nobody read them in time", board->prefix,
        (unsigned)(overflows - board->overflows_told));
    board->overflows_told = overflows;
    *error = false;
    return 1;
}
