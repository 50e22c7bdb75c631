/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Command words, the client's request builder and the server's request parser (seed 000, "LBP16 COMMANDS"). */
#include <hm2/lbp16.h>

#include <string.h>

#include <hm2/bytes.h>

/* [12:10] memory space, [9:8] item size, [6:0] count */
#define SPACE_SHIFT 10u
#define SIZE_SHIFT  8u
#define COUNT_MASK  0x7Fu

#define WORD_BYTES    2u
#define ADDRESS_BYTES 2u

_Static_assert(COUNT_MASK == LBP16_MAX_COUNT, "N is seven bits");

int lbp16_encode(const struct lbp16_command *const command, uint16_t *const word)
{
    const unsigned space = (unsigned)command->space;
    const unsigned size = (unsigned)command->size;
    if (command->count < 1u || command->count > LBP16_MAX_COUNT || space > 7u || size > 3u)
        return HM2_ERR_RANGE;
    *word = (uint16_t)((command->write ? LBP16_W : 0u) | (command->has_address ? LBP16_A : 0u) |
                       (command->info ? LBP16_C : 0u) | space << SPACE_SHIFT | size << SIZE_SHIFT |
                       (command->increment ? LBP16_I : 0u) | command->count);
    return 0;
}

int lbp16_decode(const uint16_t word, struct lbp16_command *const command)
{
    *command = (struct lbp16_command){
        .write = (word & LBP16_W) != 0,
        .has_address = (word & LBP16_A) != 0,
        .info = (word & LBP16_C) != 0,
        .increment = (word & LBP16_I) != 0,
        .space = (enum lbp16_space)(word >> SPACE_SHIFT & 7u),
        .size = (enum lbp16_size)(word >> SIZE_SHIFT & 3u),
        .count = word & COUNT_MASK,
    };
    return command->count == 0 ? HM2_ERR_MALFORMED : 0;
}

/* ---- client ----------------------------------------------------------------------------------------------------- */

void lbp16_builder_init(struct lbp16_builder *const builder, void *const data, const size_t capacity)
{
    *builder = (struct lbp16_builder){
        .data = data,
        .capacity = capacity < LBP16_MAX_REQUEST_BYTES ? capacity : LBP16_MAX_REQUEST_BYTES,
    };
}

static int fail(struct lbp16_builder *const builder, const int err)
{
    if (builder->error == 0)
        builder->error = err;
    return builder->error;
}

/* Append command word and address, with room for payload_bytes behind them; nothing is appended on an error. */
static int add_header(struct lbp16_builder *const builder, const struct lbp16_command *const command, const bool write,
                      const size_t payload_bytes)
{
    uint16_t word;
    if (builder->error)
        return builder->error;
    if (command->write != write)
        return fail(builder, HM2_ERR_INVALID);
    const int err = lbp16_encode(command, &word);
    if (err)
        return fail(builder, err);
    const size_t header = WORD_BYTES + (command->has_address ? ADDRESS_BYTES : 0u);
    if (builder->capacity - builder->used < header + payload_bytes)
        return fail(builder, HM2_ERR_NOSPACE);
    hm2_put_le16(builder->data + builder->used, word);
    if (command->has_address)
        hm2_put_le16(builder->data + builder->used + WORD_BYTES, command->address);
    builder->used += header;
    return 0;
}

int lbp16_add_read(struct lbp16_builder *const builder, const struct lbp16_command *const command,
                   size_t *const reply_offset)
{
    if (builder->error)
        return builder->error;
    /* The reply is checked first, so that a command that cannot be answered leaves no header behind. */
    if (command->count <= LBP16_MAX_COUNT && (unsigned)command->size <= 3u &&
        builder->reply_bytes + lbp16_data_bytes(command) > LBP16_MAX_REPLY_BYTES)
        return fail(builder, HM2_ERR_NOSPACE);
    const int err = add_header(builder, command, false, 0);
    if (err)
        return err;
    if (reply_offset)
        *reply_offset = builder->reply_bytes;
    builder->reply_bytes += lbp16_data_bytes(command);
    return 0;
}

int lbp16_add_write(struct lbp16_builder *const builder, const struct lbp16_command *const command,
                    const void *const data, size_t *const data_offset)
{
    const bool countable = command->count <= LBP16_MAX_COUNT && (unsigned)command->size <= 3u;
    const size_t bytes = countable ? lbp16_data_bytes(command) : 0;
    const int err = add_header(builder, command, true, bytes);
    if (err)
        return err;
    if (data_offset)
        *data_offset = builder->used;
    if (data)
        memcpy(builder->data + builder->used, data, bytes);
    else
        memset(builder->data + builder->used, 0, bytes);
    builder->used += bytes;
    return 0;
}

int lbp16_add_read_hm2(struct lbp16_builder *const builder, const uint16_t address, const unsigned count,
                       size_t *const reply_offset)
{
    const struct lbp16_command command = {.has_address = true,
                                          .space = LBP16_SPACE_HM2,
                                          .size = LBP16_SIZE_32,
                                          .increment = true,
                                          .count = count,
                                          .address = address};
    return lbp16_add_read(builder, &command, reply_offset);
}

int lbp16_add_write_hm2(struct lbp16_builder *const builder, const uint16_t address, const unsigned count,
                        const void *const data, size_t *const data_offset)
{
    const struct lbp16_command command = {.write = true,
                                          .has_address = true,
                                          .space = LBP16_SPACE_HM2,
                                          .size = LBP16_SIZE_32,
                                          .increment = true,
                                          .count = count,
                                          .address = address};
    return lbp16_add_write(builder, &command, data, data_offset);
}

int lbp16_add_read16(struct lbp16_builder *const builder, const enum lbp16_space space, const uint16_t address,
                     const unsigned count, size_t *const reply_offset)
{
    const struct lbp16_command command = {.has_address = true,
                                          .space = space,
                                          .size = LBP16_SIZE_16,
                                          .increment = true,
                                          .count = count,
                                          .address = address};
    return lbp16_add_read(builder, &command, reply_offset);
}

int lbp16_add_write16(struct lbp16_builder *const builder, const enum lbp16_space space, const uint16_t address,
                      const unsigned count, const uint16_t *const values, size_t *const data_offset)
{
    const struct lbp16_command command = {.write = true,
                                          .has_address = true,
                                          .space = space,
                                          .size = LBP16_SIZE_16,
                                          .increment = true,
                                          .count = count,
                                          .address = address};
    size_t at;
    const int err = lbp16_add_write(builder, &command, NULL, &at);
    if (err)
        return err;
    for (unsigned i = 0; values && i < count; i++)
        hm2_put_le16(builder->data + at + 2u * i, values[i]);
    if (data_offset)
        *data_offset = at;
    return 0;
}

int lbp16_add_read_info(struct lbp16_builder *const builder, const enum lbp16_space space, size_t *const reply_offset)
{
    const struct lbp16_command command = {.has_address = true,
                                          .info = true,
                                          .space = space,
                                          .size = LBP16_SIZE_16,
                                          .increment = true,
                                          .count = LBP16_INFO_BYTES / 2u};
    return lbp16_add_read(builder, &command, reply_offset);
}

/* ---- server ----------------------------------------------------------------------------------------------------- */

void lbp16_parser_init(struct lbp16_parser *const parser, const void *const data, const size_t len)
{
    *parser = (struct lbp16_parser){.data = data, .left = len};
}

static void consume(struct lbp16_parser *const parser, const size_t bytes)
{
    if (bytes > 0) { /* an empty datagram may have no address at all */
        parser->data += bytes;
        parser->left -= bytes;
    }
}

int lbp16_parser_next(struct lbp16_parser *const parser, struct lbp16_command *const command,
                      const uint8_t **const payload, size_t *const payload_len, bool *const truncated)
{
    *payload = NULL;
    *payload_len = 0;
    *truncated = false;
    if (parser->left < WORD_BYTES) { /* nothing, or the stray odd byte that the firmware ignores */
        consume(parser, parser->left);
        return 0;
    }
    const int err = lbp16_decode(hm2_get_le16(parser->data), command);
    consume(parser, WORD_BYTES);
    if (err)
        return err;
    if (command->has_address && parser->left < ADDRESS_BYTES) {
        *truncated = true;
        consume(parser, parser->left);
    } else if (command->has_address) {
        command->address = hm2_get_le16(parser->data);
        consume(parser, ADDRESS_BYTES);
    }
    if (!command->write)
        return 1;
    const size_t announced = lbp16_data_bytes(command);
    *payload = parser->data;
    *payload_len = announced < parser->left ? announced : parser->left;
    *truncated = *truncated || *payload_len < announced;
    consume(parser, *payload_len);
    return 1;
}
