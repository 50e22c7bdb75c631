/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Little-endian loads and stores and modular counter differences. LBP16 data, addresses and HostMot2 registers are
 * little endian throughout (seed 000, "LBP16 COMMANDS"). Realtime safe; no alignment is required.
 */
#ifndef HM2_BYTES_H
#define HM2_BYTES_H

#include <stdint.h>
#include <string.h>

static inline uint16_t hm2_get_le16(const uint8_t *const p)
{
    return (uint16_t)(p[0] | (uint16_t)(p[1] << 8));
}

static inline uint32_t hm2_get_le32(const uint8_t *const p)
{
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    uint32_t value;
    memcpy(&value, p, sizeof value);
    return value;
#else
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
#endif
}

static inline void hm2_put_le16(uint8_t *const p, const uint16_t value)
{
    p[0] = (uint8_t)value;
    p[1] = (uint8_t)(value >> 8);
}

static inline void hm2_put_le32(uint8_t *const p, const uint32_t value)
{
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    memcpy(p, &value, sizeof value);
#else
    p[0] = (uint8_t)value;
    p[1] = (uint8_t)(value >> 8);
    p[2] = (uint8_t)(value >> 16);
    p[3] = (uint8_t)(value >> 24);
#endif
}

/* Difference of two free-running counters; exact across the wrap while the true difference fits the signed type. */
static inline int32_t hm2_delta32(const uint32_t now, const uint32_t before)
{
    return (int32_t)(now - before);
}

static inline int16_t hm2_delta16(const uint16_t now, const uint16_t before)
{
    return (int16_t)(uint16_t)(now - before);
}

#endif
