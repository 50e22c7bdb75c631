/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A link that writes down what passes through it: hm2capture(5). */
#include <hm2/link.h>

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "exchange.h"

struct record {
    struct link base;
    struct link *inner;
    FILE *file;
    int64_t start_ns;
    char hex[2 * EXCHANGE_MAX_DATAGRAM_BYTES + 1];
};

static int64_t elapsed_ns(struct record *const record)
{
    return link_now_ns(record->inner) - record->start_ns;
}

static void copy_counters(struct record *const record)
{
    const struct link_counters *const inner = &record->inner->counters;
    struct link_counters *const outer = &record->base.counters;
    outer->sent = inner->sent;
    outer->received = inner->received;
    outer->send_errors = inner->send_errors;
    outer->receive_errors = inner->receive_errors;
    __atomic_store_n(&outer->strangers, link_strangers(record->inner), __ATOMIC_RELAXED);
}

/* One line. It is flushed at once: the datagrams before a crash are the interesting ones. */
static void write_line(struct record *const record, const int64_t at_ns, const char direction,
                       const uint8_t *const data, const size_t len)
{
    static const char digits[] = "0123456789abcdef";
    if (len > EXCHANGE_MAX_DATAGRAM_BYTES) {
        (void)fprintf(record->file, "# %" PRId64 " %c %zu bytes, longer than a capture can hold\n", at_ns, direction,
                      len);
        return;
    }
    for (size_t i = 0; i < len; i++) {
        record->hex[2 * i] = digits[data[i] >> 4];
        record->hex[2 * i + 1] = digits[data[i] & 15u];
    }
    record->hex[2 * len] = '\0';
    (void)fprintf(record->file, "%" PRId64 " %c %s\n", at_ns, direction, len > 0 ? record->hex : "-");
    (void)fflush(record->file);
}

static int record_send(struct link *const link, const void *const data, const size_t len)
{
    struct record *const record = (struct record *)link;
    const int64_t at_ns = elapsed_ns(record);
    const int err = link_send(record->inner, data, len);
    if (err) {
        (void)fprintf(record->file, "%" PRId64 " ! %s\n", at_ns, hm2_strerror(err));
        (void)fflush(record->file);
    } else {
        write_line(record, at_ns, '>', data, len);
    }
    copy_counters(record);
    return err;
}

static int record_recv(struct link *const link, void *const data, const size_t cap, const int64_t deadline_ns,
                       const int64_t clock_ns)
{
    struct record *const record = (struct record *)link;
    const int len = link_recv_from(record->inner, data, cap, deadline_ns, clock_ns);
    if (len >= 0)
        write_line(record, elapsed_ns(record), '<', data, (size_t)len);
    else if (len == HM2_ERR_NOSPACE)
        (void)fprintf(record->file, "# %" PRId64 " < longer than the %zu bytes that were asked for\n",
                      elapsed_ns(record), cap);
    copy_counters(record);
    return len;
}

static int64_t record_now(struct link *const link)
{
    return link_now_ns(((struct record *)link)->inner);
}

static void record_close(struct link *const link)
{
    struct record *const record = (struct record *)link;
    link_close(record->inner);
    (void)fclose(record->file);
    free(record);
}

static const struct link_ops record_ops = {
    .send = record_send,
    .recv = record_recv,
    .now_ns = record_now,
    .close = record_close,
};

int link_record_open(struct link **const link, struct link *const inner, const char *const path,
                     struct hm2_diag *const diag)
{
    struct record *const record = calloc(1, sizeof *record);
    if (!record)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "No memory to record into %s.", path);
    record->base.ops = &record_ops;
    record->inner = inner;
    record->start_ns = link_now_ns(inner);
    record->file = fopen(path, "we");
    if (!record->file || fputs("hm2capture 1\n", record->file) < 0 || fflush(record->file) != 0) {
        const int err = hm2_diag_add(diag, HM2_ERR_IO, "Capture file %s cannot be written: %s.", path, strerror(errno));
        if (record->file)
            (void)fclose(record->file);
        free(record);
        return err;
    }
    copy_counters(record);
    *link = &record->base;
    return 0;
}
