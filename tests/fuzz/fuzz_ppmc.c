/* SPDX-License-Identifier: GPL-2.0-or-later */
/* PPMC boards. First byte even: a request to the simulated bus, which is answered or refused within its limits. Odd: a
 * bus that brings the rest of the bytes, whatever they are, to the driver, which must not trust any of them. */
#include <stdlib.h>
#include <string.h>

#include <hm2/ppmc.h>
#include <hm2/sim_ppmc.h>

#define PERIOD_NS 1000000

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void require(const bool condition)
{
    if (!condition)
        abort();
}

static void serve(const uint8_t *const request, const size_t len)
{
    uint8_t reply[EPP_WIRE_MAX_BYTES];
    struct sim_ppmc *const bus = sim_ppmc_new(NULL);
    require(bus && sim_ppmc_add(bus, 2, 0x14) == 0 && sim_ppmc_add(bus, 5, 0x11) == 0);
    const size_t answer = sim_ppmc_serve(bus, request, len, reply);
    require(answer == 0 || (answer >= EPP_WIRE_REPLY_HEAD && answer <= sizeof reply && reply[3] <= EPP_MAX_STEPS));
    sim_ppmc_free(bus);
}

/* A board that sets up well, and then anything. A byte says first whether the cycle is answered. */
struct wild {
    struct epp base;
    struct epp *good; /* until it is NULL */
    const uint8_t *at, *end;
    int64_t now_ns;
};

static int wild_run(struct epp *const epp, const struct epp_step *const steps, const size_t count,
                    struct epp_done *const done)
{
    struct wild *const wild = (struct wild *)epp;
    if (wild->good)
        return epp_run(wild->good, steps, count, done);
    *done = (struct epp_done){0};
    for (; done->steps < count; done->steps++, done->bytes = 0)
        for (; done->bytes < steps[done->steps].len; done->bytes++) {
            const bool reads = steps[done->steps].kind == EPP_DATA_READ;
            const uint8_t byte = reads && wild->at < wild->end ? *wild->at++ : 0x14;
            if (byte == 0xFE)
                return HM2_ERR_TIMEOUT;
            if (reads)
                steps[done->steps].data[done->bytes] = byte;
        }
    return 0;
}

static int64_t wild_now(struct epp *const epp)
{
    return ((const struct wild *)epp)->now_ns;
}

static void wild_close(struct epp *const epp)
{
    (void)epp;
}

static void drive(const uint8_t *const data, const size_t size)
{
    static const struct epp_ops ops = {.run = wild_run, .now_ns = wild_now, .close = wild_close};
    struct ppmc_options options = ppmc_default_options();
    struct hm2_plain_binder *const plain = hm2_plain_binder_new();
    struct sim_ppmc *const bus = sim_ppmc_new(NULL);
    struct ppmc *const ppmc = ppmc_new();
    struct hm2_diag diag = {0};
    char text[512];
    bool error;
    require(plain && bus && ppmc && sim_ppmc_add(bus, 2, 0x14) == 0);
    struct wild wild = {.base.ops = &ops, .good = sim_ppmc_epp(bus), .at = data, .end = data + size};
    struct epp *const good = wild.good;
    options.timestamps = size > 0 && data[0] & 1 ? 1u << 2 : 0;
    options.verify = size > 0 && data[0] & 2;
    require(ppmc_setup(ppmc, &wild.base, hm2_plain_binder(plain), &options, &diag) == 0);
    wild.good = NULL;
    for (unsigned i = 0; i < 64 && wild.at < wild.end; i++) {
        wild.now_ns += PERIOD_NS;
        (void)hm2_plain_set(plain, "ppmc.0.encoder.01.index-enable", i % 3 == 0);
        ppmc_read(ppmc, PERIOD_NS);
        ppmc_write(ppmc, PERIOD_NS);
        while (ppmc_next_message(ppmc, text, sizeof text, &error) > 0)
            continue;
    }
    ppmc_stop(ppmc);
    ppmc_free(ppmc);
    epp_close(good);
    sim_ppmc_free(bus);
    hm2_plain_binder_free(plain);
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    if (size == 0)
        return 0;
    if (data[0] & 1)
        drive(data + 1, size - 1);
    else
        serve(data + 1, size - 1);
    return 0;
}
