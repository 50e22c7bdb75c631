/* SPDX-License-Identifier: GPL-2.0-or-later */
/* What arrives at a client: the plan's judgement of datagrams, in any order among requests and writes, and information
 * areas. The input is a list of steps: an operation byte, then what it needs. */
#include <stdlib.h>
#include <string.h>

#include <hm2/bytes.h>
#include <hm2/lbp16.h>
#include <hm2/plan.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define SESSION  0x12345678u
#define SECTIONS 6u

struct client {
    struct hm2_plan *plan;
    struct hm2_window reads[3], writes[2];
    struct hm2_section sections[SECTIONS];
    uint32_t last_request, shown; /* numbers: of the last request, first word of the windows */
    bool outstanding;
};

static void require(const bool condition)
{
    if (!condition)
        abort();
}

static void set_up(struct client *const client)
{
    struct hm2_plan *const plan = client->plan;
    hm2_plan_init(plan, SESSION);
    require(hm2_plan_add_read(plan, &client->reads[0], HM2_RANK_NORMAL, 0x1000, 3, NULL) == 0);
    require(hm2_plan_add_read(plan, &client->reads[1], HM2_RANK_FIRST, 0x3000, 1, NULL) == 0);
    require(hm2_plan_add_read_movable(plan, &client->reads[2], NULL) == 0);
    require(hm2_plan_add_write(plan, &client->writes[0], HM2_RANK_NORMAL, 0x2000, 127, NULL) == 0);
    require(hm2_plan_add_write(plan, &client->writes[1], HM2_RANK_NORMAL, 0x21FC, 80, NULL) == 0);
    for (unsigned i = 0; i < SECTIONS; i++)
        require(hm2_plan_add_setup(plan, &client->sections[i], (enum hm2_rank)(HM2_RANK_LAST - i % 5u),
                                   (uint16_t)(0x4000 + i * 512), 20 * i + 1,
                                   i & (HM2_SECTION_FIFO | HM2_SECTION_ON_DEMAND), NULL) == 0);
    require(hm2_plan_pipeline(plan, 1, NULL) == 0);
    require(hm2_plan_freeze(plan, NULL) == 0);
    require(hm2_plan_pipelines(plan));
}

/* A datagram of ours must be one that a card parses whole. */
static void check_datagram(const uint8_t *const data, const size_t len)
{
    struct lbp16_parser parser;
    struct lbp16_command command;
    const uint8_t *payload;
    size_t payload_len;
    bool truncated;
    int result;
    require(len > 0 && len <= LBP16_MAX_REQUEST_BYTES);
    lbp16_parser_init(&parser, data, len);
    while ((result = lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated)) == 1)
        require(!truncated);
    require(result == 0);
}

/* Bytes from the input where a reply would stand; short inputs leave what was there before. */
static void receive(struct client *const client, const uint8_t *const bytes, const size_t len, const size_t claimed)
{
    const size_t good = hm2_plan_reply_bytes(client->plan);
    uint8_t *const buffer = hm2_plan_reply_buffer(client->plan);
    memcpy(buffer, bytes, len);
    const uint32_t number = hm2_get_le32(buffer + good - 14);
    const uint32_t turn_number = hm2_get_le32(buffer + good + 6 - 14);
    const enum hm2_reply verdict = hm2_plan_judge(client->plan, claimed);
    const bool fresh = claimed == good && client->outstanding && number == client->last_request;
    /* The reply to a turn has six bytes more, here in front of everything. */
    const bool turn = claimed == good + 6;
    const bool fresh_turn = turn && client->outstanding && turn_number == client->last_request;
    require((verdict == HM2_REPLY_FRESH) == (fresh || fresh_turn));
    require(claimed == good || turn || verdict == HM2_REPLY_MALFORMED);
    if (fresh || fresh_turn) {
        client->outstanding = false;
        client->shown = hm2_get_le32(buffer); /* FIRST: the register at 0x3000 leads the reply */
    }
    require(hm2_window_get(&client->reads[1], 0) == client->shown);
}

/* One step; returns the bytes of the input that it used. */
static size_t step(struct client *const client, const uint8_t *const data, const size_t size)
{
    struct hm2_plan *const plan = client->plan;
    struct hm2_section *const section = &client->sections[data[0] / 16u % SECTIONS];
    const size_t good = hm2_plan_reply_bytes(plan);
    const size_t rest = size - 1;
    size_t len;
    switch (data[0] % 10u) {
    case 0:
        check_datagram(hm2_plan_request(plan, &len), len);
        client->last_request++;
        client->outstanding = true;
        return 1;
    case 1:
        check_datagram(hm2_plan_write(plan, &len), len);
        return 1;
    case 2:
        hm2_plan_write_failed(plan);
        return 1;
    case 3:
        hm2_plan_give_up(plan);
        client->outstanding = false;
        return 1;
    case 4:
        hm2_plan_touch_all(plan);
        return 1;
    case 5:
        hm2_section_touch(section);
        require(!hm2_section_confirmed(section));
        return 1;
    case 6:
        hm2_section_set(section, section->words - 1u, hm2_section_get(section, 0) + 1u);
        return 1;
    case 9:
        check_datagram(hm2_plan_turn(plan, 150, &len), len);
        client->last_request++;
        client->outstanding = true;
        return 1;
    case 7: /* a datagram of the right length */
        len = rest < good ? rest : good;
        receive(client, data + 1, len, good);
        return 1 + len;
    default: /* of any length, up to what the buffer takes */
        len = rest < hm2_plan_reply_capacity(plan) ? rest : hm2_plan_reply_capacity(plan);
        receive(client, data + 1, len, len);
        return 1 + len;
    }
}

static void check_info(const uint8_t *const data, const size_t size)
{
    struct lbp16_info info, again;
    uint8_t bytes[LBP16_INFO_BYTES];
    for (unsigned space = 0; space < 8; space++) {
        const int err = lbp16_info_decode((enum lbp16_space)space, data, size, &info);
        require((err == HM2_ERR_MALFORMED) == (size < LBP16_INFO_BYTES));
        if (err)
            continue;
        lbp16_info_encode(&info, bytes);
        require(lbp16_info_decode((enum lbp16_space)space, bytes, sizeof bytes, &again) == 0);
        require(strcmp(info.name, again.name) == 0 && info.type == again.type && info.pointer == again.pointer &&
                info.size_log2 == again.size_log2 && info.page_log2 == again.page_log2 &&
                info.erase_log2 == again.erase_log2 && info.writable == again.writable);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    struct client client = {.plan = malloc(hm2_plan_size())};
    if (!client.plan)
        return 0;
    set_up(&client);
    for (size_t at = 0; at < size;)
        at += step(&client, data + at, size - at);
    free(client.plan);
    check_info(data, size);
    return 0;
}
