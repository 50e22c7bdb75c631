/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "trace.h"

const char *const trace_part_names[TRACE_PARTS] = {
    [PART_LATE] = "late",     [PART_SEND] = "send",   [PART_REPLY] = "reply",
    [PART_DECODE] = "decode", [PART_WRITE] = "write", [PART_TOTAL] = "total",
};

static int64_t span(const uint32_t from_ns, const uint32_t to_ns)
{
    return to_ns == 0 || to_ns < from_ns ? -1 : (int64_t)to_ns - from_ns;
}

static int64_t late_ns(const struct trace *const trace, const size_t index)
{
    if (index == 0)
        return -1;
    const int64_t late = trace->cycles[index].start_ns - trace->cycles[index - 1].start_ns - trace->head.period_ns;
    return late > 0 ? late : 0;
}

int64_t trace_part_ns(const struct trace *const trace, const size_t index, const enum trace_part part)
{
    const struct hm2_flight_cycle *const c = &trace->cycles[index];
    switch (part) {
    case PART_LATE:
        return late_ns(trace, index);
    case PART_SEND:
        return span(0, c->sent_ns);
    case PART_REPLY:
        return span(c->sent_ns, c->received_ns);
    case PART_DECODE:
        return c->received_ns == 0 ? -1 : span(c->received_ns, c->decoded_ns);
    case PART_WRITE:
        return c->write_ns == 0 ? -1 : span(c->write_ns, c->written_ns);
    case PART_TOTAL:
        return span(0, c->written_ns > c->decoded_ns ? c->written_ns : c->decoded_ns);
    case TRACE_PARTS:
        break;
    }
    return -1;
}

const char *trace_flags(const struct hm2_flight_cycle *const cycle)
{
    static const struct {
        uint8_t flag;
        const char *name;
    } flags[] = {{HM2_FLIGHT_LOST, "lost"},
                 {HM2_FLIGHT_WRITE_LOST, "write-lost"},
                 {HM2_FLIGHT_SLOW, "slow"},
                 {HM2_FLIGHT_FAILED, "failed"}};
    for (size_t i = 0; i < sizeof flags / sizeof flags[0]; i++)
        if (cycle->flags & flags[i].flag)
            return flags[i].name;
    return "";
}
