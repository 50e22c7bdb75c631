/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <hm2/lbp.h>

#include <string.h>

#include <hm2/bytes.h>

#define CRC_POLYNOMIAL 0x8Cu /* x^8 + x^5 + x^4 + 1, the lowest bit first */
#define NS_PER_S       INT64_C(1000000000)

uint8_t lbp_crc8(uint8_t crc, const void *const data, const size_t len)
{
    const uint8_t *const bytes = data;
    for (size_t i = 0; i < len; i++) {
        crc ^= bytes[i];
        for (unsigned bit = 0; bit < 8; bit++)
            crc = (uint8_t)(crc >> 1 ^ (crc & 1u ? CRC_POLYNOMIAL : 0u));
    }
    return crc;
}

int64_t lbp_gap_ns(const unsigned tenths, const uint32_t baud)
{
    return baud ? NS_PER_S * LBP_CHARACTER_BITS / 10 * tenths / baud : 0;
}

static unsigned data_bytes(const uint8_t code)
{
    return 1u << (code & LBP_SIZE);
}

unsigned lbp_address_bytes(const uint8_t code)
{
    return (code & LBP_KIND) == LBP_DATA && code & LBP_ADDRESS ? 2 : 0;
}

unsigned lbp_sent_bytes(const uint8_t code)
{
    if (!(code & LBP_WRITE))
        return lbp_address_bytes(code);
    if ((code & LBP_KIND) == LBP_DATA)
        return lbp_address_bytes(code) + data_bytes(code);
    return (code & LBP_KIND) == LBP_LOCAL && code != LBP_RESET_PARSER ? 1 : 0;
}

unsigned lbp_returned_bytes(const uint8_t code)
{
    if (code & LBP_WRITE)
        return 0;
    if ((code & LBP_KIND) == LBP_DATA)
        return data_bytes(code);
    return (code & LBP_KIND) == LBP_LOCAL ? 1 : 0;
}

uint8_t lbp_data_code(const unsigned bytes)
{
    for (unsigned size = 0; size <= LBP_SIZE; size++)
        if (bytes == 1u << size)
            return (uint8_t)(LBP_DATA | LBP_ADDRESS | size);
    return 0;
}

int lbp_encode(const struct lbp_command *const command, uint8_t *const message, const size_t capacity)
{
    const unsigned kind = command->code & LBP_KIND, address = lbp_address_bytes(command->code);
    const size_t len = 1u + address + command->len + 1u;
    if (kind == 0 || command->len > LBP_MAX_DATA ||
        (kind != LBP_RPC && address + command->len != lbp_sent_bytes(command->code)))
        return HM2_ERR_RANGE;
    if (len > capacity)
        return HM2_ERR_NOSPACE;
    message[0] = command->code;
    if (address > 0)
        hm2_put_le16(message + 1, command->address);
    memcpy(message + 1 + address, command->data, command->len);
    message[len - 1] = lbp_crc8(0, message, len - 1);
    return (int)len;
}

int lbp_check_reply(const uint8_t *const message, const size_t len, const size_t bytes)
{
    return len == bytes + 1 && lbp_crc8(0, message, len) == 0 ? 0 : HM2_ERR_MALFORMED;
}
