/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The frames of a packet UART beside its rings of bytes. */
#include "serial.h"

void frames_put(struct frame_ring *const ring, const unsigned frame)
{
    const unsigned head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    ring->frame[head % FRAME_PLACES] = (uint16_t)frame;
    atomic_store_explicit(&ring->head, head + 1u, memory_order_release);
}

unsigned frames_oldest(const struct frame_ring *const ring)
{
    const unsigned tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    return frames_used(ring) > 0 ? ring->frame[tail % FRAME_PLACES] : 0;
}

void frames_drop(struct frame_ring *const ring)
{
    const unsigned tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    atomic_store_explicit(&ring->tail, tail + 1u, memory_order_release);
}

void serial_drop_frames(struct hm2_serial *const port)
{
    while (frames_used(&port->tx_frames) > 0)
        frames_drop(&port->tx_frames);
    while (frames_used(&port->rx_frames) > 0)
        frames_drop(&port->rx_frames);
    ring_drop(&port->tx, RING_BYTES);
    ring_drop(&port->rx, RING_BYTES);
}

int hm2_serial_put_frame(struct hm2_serial *const port, const uint8_t *const bytes, const size_t len)
{
    if (!port->settings.frames)
        return HM2_ERR_STATE;
    if (len == 0 || len > HM2_SERIAL_FRAME_BYTES)
        return HM2_ERR_RANGE;
    if (frames_used(&port->tx_frames) == FRAME_PLACES || len > RING_BYTES - ring_used(&port->tx))
        return HM2_ERR_NOSPACE;
    (void)ring_put(&port->tx, bytes, len);
    frames_put(&port->tx_frames, (unsigned)len);
    return 0;
}

static void drop_oldest(struct hm2_serial *const port)
{
    ring_drop(&port->rx, frames_oldest(&port->rx_frames) & ~FRAME_SPOILT);
    frames_drop(&port->rx_frames);
}

size_t hm2_serial_next_frame(struct hm2_serial *const port)
{
    while (frames_oldest(&port->rx_frames) & FRAME_SPOILT)
        drop_oldest(port);
    return frames_oldest(&port->rx_frames);
}

size_t hm2_serial_get_frame(struct hm2_serial *const port, uint8_t *const bytes, const size_t size)
{
    const size_t whole = hm2_serial_next_frame(port), given = size < whole ? size : whole;
    if (whole == 0)
        return 0;
    (void)ring_get(&port->rx, bytes, given);
    ring_drop(&port->rx, whole - given);
    frames_drop(&port->rx_frames);
    return given;
}

bool hm2_serial_lost(struct hm2_serial *const port)
{
    const struct hm2_serial_counts counts = hm2_serial_counts(port);
    const uint32_t lost = counts.rx_errors + counts.rx_overruns + counts.rx_uncertain + counts.tx_uncertain;
    const bool more = lost != port->told_lost;
    port->told_lost = lost;
    return more;
}
