/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "map.h"

#include <stddef.h>

#define ANY_BASE 0u

/* Base addresses of the new map where they differ from the old one (register map 2.2); ANY_BASE: a module that only
 * the newer firmware has. */
static const struct {
    uint8_t gtag;
    uint16_t base;
} new_map[] = {
    {HM2_GTAG_WAVEGEN, 0xAA00},    {HM2_GTAG_MUXED_ENCODER, 0x3600}, {HM2_GTAG_RESOLVER, 0x3C00},
    {HM2_GTAG_PWMGEN, 0x4100},     {HM2_GTAG_TPPWM, 0x4600},         {HM2_GTAG_BISS, 0x4A00},
    {HM2_GTAG_SPI, 0x5100},        {HM2_GTAG_BSPI, 0x5500},          {HM2_GTAG_DBSPI, 0x5800},
    {HM2_GTAG_SSERIAL, 0x5B00},    {HM2_GTAG_UART_TX, 0x6100},       {HM2_GTAG_UART_RX, 0x6500},
    {HM2_GTAG_PKTUART_TX, 0x6100}, {HM2_GTAG_PKTUART_RX, 0x6500},    {HM2_GTAG_SSI, 0x6900},
    {HM2_GTAG_SSR, ANY_BASE},      {HM2_GTAG_INMUX, ANY_BASE},       {HM2_GTAG_INM, ANY_BASE},
    {HM2_GTAG_OUTM, ANY_BASE},     {HM2_GTAG_RCPWM, ANY_BASE},       {HM2_GTAG_XY2MOD, ANY_BASE},
    {HM2_GTAG_SSERIALB, ANY_BASE}, {HM2_GTAG_ONESHOT, ANY_BASE},     {HM2_GTAG_PERIODM, ANY_BASE},
};

static bool is_new(const struct hm2_md *const md)
{
    for (size_t i = 0; i < sizeof new_map / sizeof *new_map; i++)
        if (new_map[i].gtag == md->gtag && (new_map[i].base == ANY_BASE || new_map[i].base == md->base))
            return true;
    return false;
}

bool sim_map_is_new(const struct hm2_idrom *const idrom)
{
    for (unsigned i = 0; i < idrom->module_count; i++)
        if (is_new(&idrom->modules[i]))
            return true;
    return false;
}
