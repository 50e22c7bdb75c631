/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "fake_card.h"
#include "unit.h"

#include <hm2/bytes.h>
#include <hm2/lbp16.h>

struct answer {
    size_t len;
    uint8_t data[LBP16_MAX_REPLY_BYTES + 64];
};

static uint32_t read_register(const struct fake_card *const card, const uint16_t address)
{
    const uint16_t rom = (uint16_t)card->image.id[3];
    if (address >= HM2_ADDR_COOKIE && address < HM2_ADDR_COOKIE + 0x10)
        return card->image.id[(address - HM2_ADDR_COOKIE) / 4];
    if (address >= rom && address - rom < (int)HM2_IDROM_WORDS * 4)
        return card->image.rom[(address - rom) / 4];
    return card->registers[address / 4];
}

static uint16_t read16(const struct fake_card *const card, const struct lbp16_command *const command,
                       const uint16_t address)
{
    if (command->space == LBP16_SPACE_INFO && address < LBP16_INFO_NAME_BYTES)
        return hm2_get_le16((const uint8_t *)card->name + address);
    if (command->space == LBP16_SPACE_TIMER && address >= LBP16_TIMER_SCRATCH && address < LBP16_TIMER_BYTES)
        return card->scratch[(address - LBP16_TIMER_SCRATCH) / 2];
    if (command->space == LBP16_SPACE_CONTROL)
        return card->received;
    return 0;
}

static void do_read(struct fake_card *const card, const struct lbp16_command *const command, struct answer *const out)
{
    for (unsigned i = 0; i < command->count; i++) {
        const size_t item = lbp16_item_bytes(command->size);
        const uint16_t address = (uint16_t)(command->address + (command->increment ? i * item : 0));
        assert_true(out->len + item <= LBP16_MAX_REPLY_BYTES);
        if (command->space == LBP16_SPACE_HM2)
            hm2_put_le32(out->data + out->len, read_register(card, address));
        else
            hm2_put_le16(out->data + out->len, read16(card, command, address));
        out->len += item;
    }
}

static void do_write(struct fake_card *const card, const struct lbp16_command *const command,
                     const uint8_t *const payload)
{
    if (command->space == LBP16_SPACE_HM2 && card->written_count < sizeof card->written / sizeof card->written[0])
        card->written[card->written_count++] = command->address;
    for (unsigned i = 0; i < command->count; i++) {
        const size_t item = lbp16_item_bytes(command->size);
        const uint16_t address = (uint16_t)(command->address + (command->increment ? i * item : 0));
        if (command->space == LBP16_SPACE_HM2)
            card->registers[address / 4] = hm2_get_le32(payload + i * item);
        else if (command->space == LBP16_SPACE_TIMER && address >= LBP16_TIMER_SCRATCH)
            card->scratch[(address - LBP16_TIMER_SCRATCH) / 2] = hm2_get_le16(payload + i * item);
    }
}

static void process(struct fake_card *const card, const uint8_t *const data, const size_t len, struct answer *const out)
{
    struct lbp16_parser parser;
    struct lbp16_command command;
    const uint8_t *payload;
    size_t payload_len;
    bool truncated = false;
    int more;
    lbp16_parser_init(&parser, data, len);
    card->received++;
    card->written_count = 0;
    while ((more = lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated)) > 0) {
        assert_false(truncated);
        if (command.write)
            do_write(card, &command, payload);
        else
            do_read(card, &command, out);
    }
    assert_int_equal(more, 0);
}

static bool has_reads(const uint8_t *const data, const size_t len)
{
    struct lbp16_parser parser;
    struct lbp16_command command;
    const uint8_t *payload;
    size_t payload_len;
    bool truncated;
    lbp16_parser_init(&parser, data, len);
    while (lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated) > 0)
        if (!command.write)
            return true;
    return false;
}

static bool take(bool *const fault)
{
    const bool now = *fault;
    *fault = false;
    return now;
}

static int handle(void *const context, struct link *const mock, const uint8_t *const data, const size_t len)
{
    struct fake_card *const card = context;
    if (take(&card->refuse_send))
        return HM2_ERR_IO;
    const bool request = has_reads(data, len);
    card->datagrams++;
    *(request ? &card->requests : &card->writes) += 1;
    if (card->dead || take(request ? &card->lose_request : &card->lose_write))
        return 0;
    struct answer answer = {.len = 0};
    process(card, data, len, &answer);
    if (answer.len == 0 || take(&card->lose_reply))
        return 0;
    const struct link_mock_reply reply = {
        .data = answer.data,
        .len = (size_t)((int)answer.len - card->cut),
        .delay_ns = FAKE_REPLY_NS + card->delay_ns,
    };
    card->cut = 0;
    card->delay_ns = 0;
    assert_int_equal(link_mock_push(mock, &reply), 0);
    if (take(&card->duplicate))
        assert_int_equal(link_mock_push(mock, &reply), 0);
    return 0;
}

void fake_card_power_cycle(struct fake_card *const card)
{
    memset(card->registers, 0, sizeof card->registers);
    memset(card->scratch, 0, sizeof card->scratch);
    card->received = 0;
}

void fake_card_open(struct fake_card *const card, const char *const name, const struct hm2_image *const image,
                    struct link **const link)
{
    memset(card, 0, sizeof *card);
    memcpy(card->name, name, strlen(name) < sizeof card->name ? strlen(name) : sizeof card->name);
    card->image = *image;
    assert_int_equal(link_mock_open(link, handle, card), 0);
}
