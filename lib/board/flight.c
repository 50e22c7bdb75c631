/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "flight.h"

#include <stdlib.h>
#include <string.h>

#include "board_private.h"

/* Behind the cycle that stopped it, a share of the ring shows what followed. */
#define SHARE_BEHIND 4u

static uint32_t since(const int64_t start_ns, const int64_t at_ns)
{
    const int64_t elapsed = at_ns - start_ns;
    if (elapsed <= 0)
        return 1; /* it did happen */
    return elapsed > UINT32_MAX ? UINT32_MAX : (uint32_t)elapsed;
}

static uint16_t bytes(const size_t count)
{
    return count > UINT16_MAX ? UINT16_MAX : (uint16_t)count;
}

/* The first cause counts; what happens until the ring is frozen belongs to it. */
static void stop_soon(struct board_flight *const flight, const enum hm2_flight_cause cause, const uint32_t cycle)
{
    if (flight->left > 0)
        return;
    flight->left = (flight->mask + 1u) / SHARE_BEHIND;
    flight->head.cause = cause;
    flight->head.cause_cycle = cycle;
}

static bool is_slow(const struct board_flight *const flight, const struct hm2_flight_cycle *const cycle)
{
    const uint32_t end_ns = cycle->written_ns > cycle->decoded_ns ? cycle->written_ns : cycle->decoded_ns;
    return flight->slow_ns > 0 && end_ns > flight->slow_ns;
}

/* A cycle is judged when the next one begins. */
static void judge_last(struct board_flight *const flight)
{
    struct hm2_flight_cycle *const cycle = flight->now;
    if (is_slow(flight, cycle))
        cycle->flags |= HM2_FLIGHT_SLOW;
    if (cycle->flags & (HM2_FLIGHT_LOST | HM2_FLIGHT_WRITE_LOST))
        stop_soon(flight, HM2_FLIGHT_BY_LOSS, cycle->number);
    else if (cycle->flags & HM2_FLIGHT_SLOW)
        stop_soon(flight, HM2_FLIGHT_BY_SLOWNESS, cycle->number);
    if (*flight->points->freeze)
        stop_soon(flight, HM2_FLIGHT_BY_REQUEST, cycle->number);
}

static bool freezes_now(struct board_flight *const flight)
{
    if (flight->left == 0 || --flight->left > 0)
        return false;
    *flight->points->freezes = *flight->points->freezes + 1u;
    flight->now = NULL;
    atomic_store_explicit(&flight->frozen, true, memory_order_release);
    return true;
}

void board_flight_begin(struct board_flight *const flight, const int64_t start_ns, const int64_t sent_ns,
                        const int64_t period_ns, const size_t request_bytes, const uint32_t bad_datagrams)
{
    if (atomic_load_explicit(&flight->frozen, memory_order_acquire))
        return;
    if (flight->now) {
        judge_last(flight);
        if (freezes_now(flight))
            return;
    }
    flight->head.period_ns = period_ns;
    flight->bad_datagrams = bad_datagrams;
    flight->now = &flight->ring[flight->begun++ & flight->mask];
    flight->kept += flight->kept <= flight->mask;
    *flight->now = (struct hm2_flight_cycle){
        .start_ns = start_ns,
        .number = flight->begun,
        .sent_ns = since(start_ns, sent_ns),
        .request_bytes = bytes(request_bytes),
    };
}

void board_flight_decoded(struct board_flight *const flight, const int64_t received_ns, const int64_t decoded_ns,
                          const size_t reply_bytes, const unsigned flags, const uint32_t bad_datagrams)
{
    struct hm2_flight_cycle *const cycle = flight->now;
    if (!cycle)
        return;
    const uint32_t bad = bad_datagrams - flight->bad_datagrams;
    cycle->flags = (uint8_t)flags;
    cycle->bad_datagrams = bad > UINT8_MAX ? UINT8_MAX : (uint8_t)bad;
    cycle->decoded_ns = since(cycle->start_ns, decoded_ns);
    if (flags & HM2_FLIGHT_LOST)
        return;
    cycle->received_ns = since(cycle->start_ns, received_ns);
    cycle->reply_bytes = bytes(reply_bytes);
}

void board_flight_written(struct board_flight *const flight, const int64_t write_ns, const int64_t written_ns,
                          const size_t write_bytes)
{
    struct hm2_flight_cycle *const cycle = flight->now;
    if (!cycle)
        return;
    cycle->write_ns = since(cycle->start_ns, write_ns);
    cycle->written_ns = since(cycle->start_ns, written_ns);
    cycle->write_bytes = bytes(write_bytes);
}

/* ---- outside realtime ---------------------------------------------------------------------------------------------
 */

int hm2_board_record(struct hm2_board *const board, const unsigned cycles, const int64_t slow_ns,
                     struct hm2_diag *const diag)
{
    if (board->state > BOARD_IDENTIFIED || board->prefix[0] || board->flight)
        return hm2_diag_add(diag, HM2_ERR_STATE, "the flight recorder is switched on once, before a board is set up");
    if (cycles < HM2_FLIGHT_MIN_CYCLES || cycles > HM2_FLIGHT_MAX_CYCLES || slow_ns < 0)
        return hm2_diag_add(diag, HM2_ERR_RANGE,
                            "flight recorder: %u cycles and a limit of %lld ns found, expected %u to %u cycles and a "
                            "limit that is not negative",
                            cycles, (long long)slow_ns, HM2_FLIGHT_MIN_CYCLES, HM2_FLIGHT_MAX_CYCLES);
    uint32_t places = HM2_FLIGHT_MIN_CYCLES;
    while (places < cycles)
        places *= 2u;
    struct board_flight *const flight = calloc(1, sizeof *flight + places * sizeof flight->ring[0]);
    if (!flight)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for a flight recorder of %u cycles", places);
    flight->mask = places - 1u;
    flight->slow_ns = slow_ns;
    board->flight = flight;
    return 0;
}

unsigned hm2_board_flight(const struct hm2_board *const board, struct hm2_flight_head *const head)
{
    const struct board_flight *const flight = board->flight;
    if (!flight || !atomic_load_explicit(&flight->frozen, memory_order_acquire))
        return 0;
    *head = flight->head;
    memcpy(head->card, board->prefix, sizeof head->card);
    return flight->kept;
}

struct hm2_flight_cycle hm2_board_flight_cycle(const struct hm2_board *const board, const unsigned index)
{
    const struct board_flight *const flight = board->flight;
    return flight->ring[(flight->begun - flight->kept + index) & flight->mask];
}

void hm2_board_flight_resume(struct hm2_board *const board)
{
    struct board_flight *const flight = board->flight;
    if (!flight || !atomic_load_explicit(&flight->frozen, memory_order_acquire))
        return;
    *flight->points->freeze = false;
    flight->kept = 0;
    atomic_store_explicit(&flight->frozen, false, memory_order_release);
}
