/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Requests as a card receives them: the parser stays inside the datagram and makes progress, and whatever it took apart
 * whole, the builder puts together again byte for byte. */
#include <stdlib.h>
#include <string.h>

#include <hm2/lbp16.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void require(const bool condition)
{
    if (!condition)
        abort();
}

/* Adds the command to the rebuilt request; false when it cannot be part of a request that a client may send. */
static bool rebuild(struct lbp16_builder *const builder, const struct lbp16_command *const command,
                    const uint8_t *const payload)
{
    const size_t used = builder->used, reply_bytes = builder->reply_bytes;
    const int err =
        command->write ? lbp16_add_write(builder, command, payload, NULL) : lbp16_add_read(builder, command, NULL);
    require(builder->used <= LBP16_MAX_REQUEST_BYTES && builder->reply_bytes <= LBP16_MAX_REPLY_BYTES);
    if (err == 0)
        return true;
    require(err == HM2_ERR_NOSPACE && builder->used == used && builder->reply_bytes == reply_bytes);
    return false;
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    uint8_t built[LBP16_MAX_REQUEST_BYTES];
    struct lbp16_builder builder;
    struct lbp16_parser parser;
    struct lbp16_command command;
    const uint8_t *payload;
    size_t payload_len;
    bool truncated, whole = true;
    int result;
    lbp16_builder_init(&builder, built, sizeof built);
    lbp16_parser_init(&parser, data, size);
    for (size_t left = size;
         (result = lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated)) == 1;) {
        require(parser.left < left && command.count >= 1 && command.count <= LBP16_MAX_COUNT);
        left = parser.left;
        require(payload_len <= (command.write ? lbp16_data_bytes(&command) : 0));
        require(payload_len == 0 || (payload >= data && payload + payload_len <= data + size));
        require(truncated || !command.write || payload_len == lbp16_data_bytes(&command));
        require(!truncated || left == 0);
        whole = whole && !truncated && rebuild(&builder, &command, payload);
    }
    require(result == 0 ? parser.left == 0 : result == HM2_ERR_MALFORMED);
    if (whole)
        require(builder.used <= size && memcmp(built, data, builder.used) == 0);
    return 0;
}
