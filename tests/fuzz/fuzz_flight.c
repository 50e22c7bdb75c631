/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Any text as a file of the flight recorder: what is accepted is written and read back the same. */
#include <stdlib.h>
#include <string.h>

#include <hm2/flight.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void again(void *const context, const struct hm2_flight_cycle *const cycle)
{
    const struct hm2_flight_cycle *const expected = context;
    if (memcmp(cycle, expected, sizeof *cycle) != 0)
        abort();
}

static void take(void *const context, const struct hm2_flight_cycle *const cycle)
{
    struct hm2_flight_head head = *(const struct hm2_flight_head *)context, back;
    char text[3 * HM2_FLIGHT_LINE_SIZE];
    struct hm2_flight_cycle one = *cycle;
    size_t len = hm2_flight_format_head(&head, text);
    len += hm2_flight_format_cycle(&one, text + len);
    if (hm2_flight_parse(text, len, &back, again, &one, NULL) != 0)
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    struct hm2_flight_head head;
    struct hm2_diag diag = {0};
    const int err = hm2_flight_parse((const char *)data, size, &head, take, &head, &diag);
    if (err != 0 && diag.problems == 0)
        abort();
    return 0;
}
