/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Serial LBP both ways. As a remote: bytes with gaps between them; every command that comes out is whole, encodes to
 * the bytes it came from, and what no parser should do is not done. As a client: the same bytes are what a remote
 * answers. Input: pairs of a byte and the time before it, in steps of 10 us.
 */
#include <stdlib.h>
#include <string.h>

#include <hm2/lbp.h>

#define STEP_NS 10000
#define GAP_NS  (100 * STEP_NS)

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void require(const bool condition)
{
    if (!condition)
        abort();
}

static void serve(const uint8_t *const data, const size_t size)
{
    struct lbp_parser parser;
    struct lbp_command command;
    uint8_t taken[LBP_MESSAGE_BYTES], encoded[LBP_MESSAGE_BYTES];
    int64_t now_ns = 0;
    lbp_parser_init(&parser, GAP_NS);
    for (unsigned i = 0; i < LBP_RPCS; i++)
        parser.rpc_bytes[i] = (uint8_t)i; /* more than LBP_MAX_DATA are not taken */
    for (size_t i = 0; i + 1 < size; i += 2) {
        now_ns += data[i + 1] * (int64_t)STEP_NS;
        const size_t before = data[i + 1] * STEP_NS > GAP_NS ? 0 : parser.len;
        require(before < sizeof taken);
        taken[before] = data[i];
        const int result = lbp_parser_take(&parser, data[i], now_ns, &command);
        require(parser.len < LBP_MESSAGE_BYTES && result <= 1 && !(parser.lost && parser.len > 0));
        if (result != 1)
            continue;
        require(lbp_encode(&command, encoded, sizeof encoded) == (int)before + 1);
        require(memcmp(encoded, taken, before + 1) == 0);
    }
}

struct answers {
    const uint8_t *data;
    size_t size;
};

/* Each command gets the next bytes: as many as the first of them says. */
static int answer(void *const context, struct link *const mock, const uint8_t *const data, const size_t len)
{
    struct answers *const answers = context;
    require(len >= 2 && lbp_crc8(0, data, len) == 0);
    if (answers->size == 0)
        return 0;
    const size_t wanted = answers->data[0] % 48u, left = answers->size - 1;
    const size_t bytes = wanted < left ? wanted : left;
    const struct link_mock_reply reply = {.data = answers->data + 1, .len = bytes, .delay_ns = 1000};
    answers->data += 1 + bytes;
    answers->size -= 1 + bytes;
    return bytes > 0 ? link_mock_push(mock, &reply) : 0;
}

static void ask(const uint8_t *const data, const size_t size)
{
    struct answers answers = {data, size};
    struct lbp_client client;
    struct lbp_identity identity;
    struct link *mock;
    uint64_t value;
    if (link_mock_open(&mock, answer, &answers) != 0)
        return;
    lbp_client_init(&client, mock, "fuzz", LBP_SETUP_BAUD, NULL);
    if (lbp_client_identify(&client, 0, &identity) == 0)
        require(strlen(identity.name) == 4);
    if (lbp_client_read(&client, 0x100, 4, &value) == 0)
        require(value <= UINT32_MAX);
    (void)!lbp_client_write(&client, 0x100, 8, 1);
    link_close(mock);
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    serve(data, size);
    ask(data, size);
    return 0;
}
