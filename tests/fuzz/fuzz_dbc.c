/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Any text as a DBC file: what is refused has a sentence; what is read has its signals within their messages, and every
 * value that is put into a frame comes back. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <hm2/dbc.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void try_signal(const struct hm2_dbc *const dbc, const struct hm2_dbc_signal *const s, const unsigned bytes)
{
    uint8_t *const frame = calloc(1, bytes); /* of just the size, so that a step beyond is seen */
    const uint64_t pattern = UINT64_C(0xA5A5A5A55A5A5A5A) >> (64u - s->bits);
    double low, high;
    if (!frame)
        return;
    hm2_dbc_put_raw(s, frame, pattern);
    if (hm2_dbc_raw(s, frame) != pattern)
        abort();
    hm2_dbc_range(s, &low, &high);
    (void)hm2_dbc_put_value(s, frame, s->start_value);
    (void)hm2_dbc_put_value(s, frame, INFINITY);
    (void)hm2_dbc_value(s, frame);
    (void)hm2_dbc_present(dbc, s, frame);
    free(frame);
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    struct hm2_dbc *dbc;
    struct hm2_diag diag = {0};
    const int err = hm2_dbc_read((const char *)data, size, "fuzz", &dbc, &diag);
    if ((err == 0) != (dbc != NULL) || (err != 0) != (diag.problems != 0))
        abort();
    for (uint32_t i = 0; dbc && i < dbc->message_count; i++) {
        const struct hm2_dbc_message *const m = &dbc->messages[i];
        for (uint32_t k = 0; k < m->signal_count; k++)
            try_signal(dbc, &dbc->signals[m->first_signal + k], m->bytes);
    }
    hm2_dbc_free(dbc);
    return 0;
}
