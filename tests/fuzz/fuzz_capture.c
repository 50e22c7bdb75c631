/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Captures (first byte even) and scripts (odd): refused with a sentence, or followed by a client that sends whatever
 * comes and receives whatever is there. */
#include <stdlib.h>
#include <string.h>

#include <hm2/link.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void require(const bool condition)
{
    if (!condition)
        abort();
}

/* Sends what the text holds right after ">", so that some exchanges go on, and receives. */
static void follow(struct link *const link, const uint8_t *const data, const size_t size)
{
    uint8_t received[1536];
    int64_t before_ns = link_now_ns(link);
    for (unsigned i = 0; i < 8; i++) {
        const size_t at = size > 0 ? (i * 7u) % size : 0;
        const size_t len = size - at < i ? size - at : i;
        require(link_send(link, data + at, len) <= 0);
        const int got = link_recv(link, received, sizeof received, before_ns + 1000);
        require(got <= (int)sizeof received);
        require(link_now_ns(link) >= before_ns);
        before_ns = link_now_ns(link);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    struct link *link = NULL;
    struct hm2_diag diag = {0};
    int err;
    if (size == 0)
        return 0;
    if (data[0] & 1) {
        char *const text = malloc(size);
        if (!text)
            return 0;
        memcpy(text, data + 1, size - 1);
        text[size - 1] = '\0';
        err = link_mock_script(&link, text, &diag);
        free(text);
    } else {
        err = link_replay_text(&link, (const char *)data + 1, size - 1, &diag);
    }
    require((err == 0) == (link != NULL) && (err == 0) == (diag.problems == 0));
    if (link) {
        follow(link, data, size);
        (void)link_mock_finish(link, &diag);
        link_close(link);
    }
    return 0;
}
