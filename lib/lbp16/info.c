/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Information areas (seed 000, "INFO AREA", "INFO AREA MEMSIZES FORMAT", "INFO AREA MEMRANGES FORMAT"). */
#include <hm2/lbp16.h>

#include <string.h>

#include <hm2/bytes.h>

enum { AT_COOKIE = 0x0, AT_SIZES = 0x2, AT_RANGES = 0x4, AT_POINTER = 0x6, AT_NAME = 0x8, NAME_BYTES = 8 };

_Static_assert(AT_NAME + NAME_BYTES == LBP16_INFO_BYTES, "the name ends the area");

#define COOKIE 0x5A00u /* + memory space */

/* MEMSIZES: [15] writable, [14:8] type, [3:0] accesses allowed */
#define SIZES_WRITABLE   0x8000u
#define SIZES_TYPE_SHIFT 8u
#define SIZES_TYPE_MASK  0x7Fu

/* MEMRANGES: [15:11] log2 erase block, [10:6] log2 page, [5:0] log2 address range */
#define RANGES_ERASE_SHIFT 11u
#define RANGES_ERASE_MASK  0x1Fu
#define RANGES_PAGE_SHIFT  6u
#define RANGES_PAGE_MASK   0x1Fu
#define RANGES_SIZE_MASK   0x3Fu

int lbp16_info_decode(const enum lbp16_space space, const uint8_t *const data, const size_t len,
                      struct lbp16_info *const info)
{
    if (len < LBP16_INFO_BYTES)
        return HM2_ERR_MALFORMED;
    const unsigned sizes = hm2_get_le16(data + AT_SIZES);
    const unsigned ranges = hm2_get_le16(data + AT_RANGES);
    *info = (struct lbp16_info){
        .cookie = hm2_get_le16(data + AT_COOKIE),
        .writable = (sizes & SIZES_WRITABLE) != 0,
        .type = sizes >> SIZES_TYPE_SHIFT & SIZES_TYPE_MASK,
        .erase_log2 = ranges >> RANGES_ERASE_SHIFT & RANGES_ERASE_MASK,
        .page_log2 = ranges >> RANGES_PAGE_SHIFT & RANGES_PAGE_MASK,
        .size_log2 = ranges & RANGES_SIZE_MASK,
        .pointer = hm2_get_le16(data + AT_POINTER),
    };
    for (unsigned i = 0; i < 4; i++)
        info->access[i] = (sizes >> i & 1u) != 0;
    memcpy(info->name, data + AT_NAME, NAME_BYTES);
    return info->cookie == COOKIE + (unsigned)space ? 0 : HM2_ERR_MISMATCH;
}

void lbp16_info_encode(const struct lbp16_info *const info, uint8_t data[const LBP16_INFO_BYTES])
{
    unsigned sizes = (info->writable ? SIZES_WRITABLE : 0u) | (info->type & SIZES_TYPE_MASK) << SIZES_TYPE_SHIFT;
    for (unsigned i = 0; i < 4; i++)
        sizes |= info->access[i] ? 1u << i : 0u;
    const unsigned ranges = (info->erase_log2 & RANGES_ERASE_MASK) << RANGES_ERASE_SHIFT |
                            (info->page_log2 & RANGES_PAGE_MASK) << RANGES_PAGE_SHIFT |
                            (info->size_log2 & RANGES_SIZE_MASK);
    hm2_put_le16(data + AT_COOKIE, info->cookie);
    hm2_put_le16(data + AT_SIZES, (uint16_t)sizes);
    hm2_put_le16(data + AT_RANGES, (uint16_t)ranges);
    hm2_put_le16(data + AT_POINTER, info->pointer);
    const size_t used = strnlen(info->name, NAME_BYTES);
    memset(data + AT_NAME, 0, NAME_BYTES);
    memcpy(data + AT_NAME, info->name, used);
}
