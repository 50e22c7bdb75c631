/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Framing as a remote does it: by what a command byte announces, and by gaps (seed 003, "FRAMING"). */
#include <hm2/lbp.h>

#include <string.h>

#include <hm2/bytes.h>

void lbp_parser_init(struct lbp_parser *const parser, const int64_t gap_ns)
{
    *parser = (struct lbp_parser){.gap_ns = gap_ns};
}

/* Length of the message that begins with this byte, its CRC included; 0 = none does. */
static size_t message_bytes(const struct lbp_parser *const parser, const uint8_t code)
{
    if ((code & LBP_KIND) == 0)
        return 0;
    if ((code & LBP_KIND) != LBP_RPC)
        return 1u + lbp_sent_bytes(code) + 1u;
    const uint8_t bytes = parser->rpc_bytes[code % LBP_RPCS];
    return bytes <= LBP_MAX_DATA ? 1u + bytes + 1u : 0;
}

static void take_apart(const uint8_t *const message, const size_t len, struct lbp_command *const command)
{
    const unsigned address = lbp_address_bytes(message[0]);
    *command = (struct lbp_command){.code = message[0], .len = (uint8_t)(len - 2u - address)};
    if (address > 0)
        command->address = hm2_get_le16(message + 1);
    memcpy(command->data, message + 1 + address, command->len);
}

static int lose(struct lbp_parser *const parser)
{
    parser->len = 0;
    parser->lost = true;
    return HM2_ERR_MALFORMED;
}

int lbp_parser_take(struct lbp_parser *const parser, const uint8_t byte, const int64_t now_ns,
                    struct lbp_command *const command)
{
    const bool gap = now_ns - parser->last_ns > parser->gap_ns;
    const bool broken = gap && parser->len > 0;
    parser->last_ns = now_ns;
    if (gap) {
        parser->len = 0;
        parser->lost = false;
    }
    if (parser->lost)
        return 0;
    if (parser->len == 0) {
        parser->needed = message_bytes(parser, byte);
        if (parser->needed == 0)
            return lose(parser);
    }
    parser->message[parser->len++] = byte;
    if (parser->len < parser->needed)
        return broken ? HM2_ERR_TIMEOUT : 0;
    if (lbp_crc8(0, parser->message, parser->len) != 0)
        return lose(parser);
    take_apart(parser->message, parser->len, command);
    parser->len = 0;
    return 1;
}
