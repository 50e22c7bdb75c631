/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Any frames on the bus: every pin stays a number, and nothing is sent but what is ours. */
#include <stdlib.h>
#include <string.h>

#include <hm2/can.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const char file[] = "BU_: A B\n"
                           "BO_ 1 R: 8 B\n SG_ outer M : 0|8@1+ (1,0) [0|0] \"\" A\n"
                           " SG_ inner m1M : 8|8@1- (1,0) [0|0] \"\" A\n SG_ deep m3 : 16|32@1- (1,0) [0|0] \"\" A\n"
                           " SG_ wide m2 : 15|56@0- (0.5,-3) [0|0] \"\" A\n"
                           "BO_ 2 F: 64 B\n SG_ d : 0|64@1- (1e300,0) [0|0] \"\" A\n"
                           " SG_ last : 503|9@0+ (1,0) [0|0] \"\" A\n"
                           "BO_ 2147483651 T: 8 A\n SG_ t : 0|33@1- (0.1,0) [0|0] \"\" B\n"
                           "SIG_VALTYPE_ 2 d : 2;\nSG_MUL_VAL_ 1 inner outer 1-1;\nSG_MUL_VAL_ 1 deep inner 3-9;\n"
                           "SG_MUL_VAL_ 1 wide outer 2-2;\nBA_ \"GenMsgCycleTime\" BO_ 2147483651 1;\n";

struct fuzz_bus {
    struct hm2_can_bus base;
    const uint8_t *at, *end;
};

/* A frame is an identifier, flags, a length and as many bytes. */
static int fuzz_receive(struct hm2_can_bus *const base, struct hm2_can_frame *const frames, const unsigned max)
{
    struct fuzz_bus *const bus = (struct fuzz_bus *)base;
    unsigned count = 0;
    for (; count < max && bus->end - bus->at >= 3; count++) {
        struct hm2_can_frame *const frame = &frames[count];
        const unsigned wanted = bus->at[2] % (HM2_CAN_MAX_BYTES + 1u);
        *frame = (struct hm2_can_frame){.id = bus->at[0],
                                        .extended = bus->at[1] & 1u,
                                        .remote = (bus->at[1] & 2u) != 0,
                                        .error = (bus->at[1] & 4u) != 0,
                                        .stamp_ns = bus->at[1] >> 3};
        bus->at += 3;
        const size_t left = (size_t)(bus->end - bus->at);
        frame->bytes = (uint8_t)(wanted < left ? wanted : left);
        memcpy(frame->data, bus->at, frame->bytes);
        bus->at += frame->bytes;
    }
    return (int)count;
}

static int fuzz_send(struct hm2_can_bus *const base, const struct hm2_can_frame *const frame)
{
    (void)base;
    if (frame->id != 3 || !frame->extended || frame->bytes != 8)
        abort();
    return 0;
}

static void fuzz_close(struct hm2_can_bus *const base)
{
    (void)base;
}

static void check_pins(const struct hm2_plain_binder *const plain)
{
    for (size_t i = 0; i < hm2_plain_count(plain); i++) {
        const struct hm2_plain_object *const object = hm2_plain_at(plain, i);
        const double value = hm2_point_load(object->point->type, object->value);
        if (value - value < 0.0 || value - value > 0.0)
            abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    static const struct hm2_can_bus_ops ops = {fuzz_receive, fuzz_send, fuzz_close};
    static const struct hm2_can_options options = {.prefix = "can.0", .node = "A"};
    struct fuzz_bus bus = {.base.ops = &ops, .at = data, .end = data + size};
    struct hm2_plain_binder *const plain = hm2_plain_binder_new();
    struct hm2_dbc *dbc;
    struct hm2_can *can;
    if (!plain || hm2_dbc_read(file, strlen(file), "fuzz", &dbc, NULL) || hm2_can_new(dbc, &options, &can, NULL) ||
        hm2_can_setup(can, &bus.base, hm2_plain_binder(plain), NULL))
        abort();
    for (int64_t now_ns = 0; now_ns < 4000000; now_ns += 1000000) {
        hm2_can_read(can, now_ns);
        hm2_can_write(can, now_ns);
    }
    check_pins(plain);
    hm2_can_free(can);
    hm2_dbc_free(dbc);
    hm2_plain_binder_free(plain);
    return 0;
}
