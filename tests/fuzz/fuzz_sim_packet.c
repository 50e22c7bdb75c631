/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Packets and frames at a simulated card: whatever comes, the reply stays within what a frame holds and the card
 * answers afterwards. Input: records of a length byte (times four), a kind byte and bytes. */
#include <stdlib.h>
#include <string.h>

#include <hm2/sim.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define MAX_RECORD   1472u
#define STEP_NS      1000000
#define LONG_WAIT_NS 100000000000

static void require(const bool condition)
{
    if (!condition)
        abort();
}

static void answers(struct sim_card *const card, const int64_t now_ns)
{
    static const uint8_t request[] = {0x01, 0x42, 0x00, 0x01};
    static const uint8_t cookie[] = {0xFE, 0xCA, 0xAA, 0x55};
    uint8_t reply[16];
    int64_t reply_ns;
    require(sim_card_packet(card, now_ns, request, sizeof request, reply, sizeof reply, &reply_ns) == sizeof cookie);
    require(memcmp(reply, cookie, sizeof cookie) == 0);
    require(reply_ns >= now_ns);
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    static const char *const profiles[] = {"7i96s", "7i93", "7i96s_7i77d", "7i93"};
    const struct sim_card_options options = {.profile = profiles[size > 0 ? data[0] & 3 : 0]};
    struct sim_card *card = NULL;
    uint8_t reply[2048];
    int64_t now_ns = 0;
    require(sim_card_new(&card, &options, NULL) == 0);
    for (size_t at = 1; at + 2 <= size; now_ns += STEP_NS) {
        size_t len = data[at] * 4u;
        const bool frame = data[at + 1] & 1;
        at += 2;
        len = len < size - at ? len : size - at;
        len = len < MAX_RECORD ? len : MAX_RECORD;
        const size_t got = frame ? sim_card_frame(card, now_ns, data + at, len, reply, sizeof reply, NULL)
                                 : sim_card_packet(card, now_ns, data + at, len, reply, sizeof reply, NULL);
        require(got <= 1536);
        at += len;
    }
    answers(card, now_ns + LONG_WAIT_NS);
    sim_card_free(card);
    return 0;
}
