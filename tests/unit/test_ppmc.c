/* SPDX-License-Identifier: GPL-2.0-or-later */
/* PPMC encoders as points, against the simulated bus, in virtual time. */
#include "unit.h"

#include <inttypes.h>
#include <math.h>

#include <hm2/ppmc.h>
#include <hm2/sim_ppmc.h>

#define PERIOD_NS       1000000
#define FAULTS_ON_READS (1u << SIM_PPMC_FAULT_ZEROS | 1u << SIM_PPMC_FAULT_ONES | 1u << SIM_PPMC_FAULT_RESIDUE)
#define ALL_FAULTS      ((1u << SIM_PPMC_FAULTS) - 1u)

/* Sanitizers make it slow, and see every line after a few. */
#ifdef __SANITIZE_ADDRESS__
#define TOTAL_CYCLES 100000
#else
#define TOTAL_CYCLES 1000000
#endif

struct rig {
    struct sim_ppmc *bus;
    struct ppmc *ppmc;
    struct hm2_plain_binder *plain;
    struct ppmc_options options;
    int64_t next_ns;
};

static void rig_new(struct rig *const rig, const struct sim_ppmc_options *const options)
{
    *rig = (struct rig){.options = ppmc_default_options()};
    rig->bus = sim_ppmc_new(options);
    rig->plain = hm2_plain_binder_new();
    rig->ppmc = ppmc_new();
    assert_non_null(rig->bus);
}

static void rig_add(struct rig *const rig, const unsigned slot, const uint8_t id)
{
    assert_int_equal(sim_ppmc_add(rig->bus, slot, id), 0);
}

static int rig_setup(struct rig *const rig, struct hm2_diag *const diag)
{
    const int err = ppmc_setup(rig->ppmc, sim_ppmc_epp(rig->bus), hm2_plain_binder(rig->plain), &rig->options, diag);
    rig->next_ns = sim_ppmc_now_ns(rig->bus) + PERIOD_NS;
    return err;
}

static void rig_start(struct rig *const rig)
{
    struct hm2_diag diag = {0};
    if (rig_setup(rig, &diag) != 0)
        fail_msg("%s", diag.text);
}

/* Two boards at addresses 2 and 4, at the fastest filter rate. */
static void rig_two(struct rig *const rig, const struct sim_ppmc_options *const options)
{
    rig_new(rig, options);
    rig_add(rig, 2, 0x14);
    rig_add(rig, 4, 0x14);
    rig->options.filter[2] = rig->options.filter[4] = PPMC_10_MHZ;
}

static void rig_free(struct rig *const rig)
{
    ppmc_stop(rig->ppmc);
    ppmc_free(rig->ppmc);
    sim_ppmc_free(rig->bus);
    hm2_plain_binder_free(rig->plain);
}

static void cycle(struct rig *const rig)
{
    sim_ppmc_set_time(rig->bus, rig->next_ns);
    ppmc_read(rig->ppmc, PERIOD_NS);
    ppmc_write(rig->ppmc, PERIOD_NS);
    rig->next_ns += PERIOD_NS;
}

static void cycles(struct rig *const rig, const unsigned count)
{
    for (unsigned i = 0; i < count; i++)
        cycle(rig);
}

static double get(const struct rig *const rig, const char *const name)
{
    char full[64];
    int err;
    (void)snprintf(full, sizeof full, "ppmc.0.%s", name);
    const double value = hm2_plain_get(rig->plain, full, &err);
    if (err)
        fail_msg("there is no %s", full);
    return value;
}

static void set(const struct rig *const rig, const char *const name, const double value)
{
    char full[64];
    (void)snprintf(full, sizeof full, "ppmc.0.%s", name);
    assert_int_equal(hm2_plain_set(rig->plain, full, value), 0);
}

/* Pins that are looked at in every cycle, found once. */
struct watch {
    const hm2_s32_t *count[8], *delta[8];
    const hm2_float_t *position[8], *velocity[8];
    const hm2_bit_t *index[8], *fault;
    hm2_bit_t *index_enable[8];
};

static void *value_of(const struct rig *const rig, const unsigned encoder, const char *const name)
{
    char full[64];
    (void)snprintf(full, sizeof full, "ppmc.0.encoder.%02u.%s", encoder, name);
    const struct hm2_plain_object *const object = hm2_plain_find(rig->plain, full);
    assert_non_null(object);
    return object->value;
}

static void watch_all(struct watch *const watch, const struct rig *const rig, const unsigned encoders)
{
    for (unsigned i = 0; i < encoders; i++) {
        watch->count[i] = value_of(rig, i, "count");
        watch->delta[i] = value_of(rig, i, "delta");
        watch->position[i] = value_of(rig, i, "position");
        watch->velocity[i] = value_of(rig, i, "velocity");
        watch->index[i] = value_of(rig, i, "index");
        watch->index_enable[i] = value_of(rig, i, "index-enable");
    }
    watch->fault = hm2_plain_find(rig->plain, "ppmc.0.fault")->value;
}

static unsigned slot_of(const unsigned encoder)
{
    return encoder < 4 ? 2 : 4;
}

static int64_t held(struct rig *const rig, const unsigned encoder)
{
    return sim_ppmc_truth(rig->bus, slot_of(encoder), encoder % 4).held_counted;
}

static void turn(struct rig *const rig, const unsigned encoder, const int32_t rate)
{
    sim_ppmc_set_rate(rig->bus, slot_of(encoder), encoder % 4, rate);
}

/* ---- what is on the bus ------------------------------------------------------------------------------------------ */

static void a_scan_names_all_boards(void **state)
{
    (void)state;
    static const struct {
        unsigned slot;
        uint8_t id;
        unsigned slots, encoders;
        bool index, filter, timestamps;
    } rows[] = {
        {0, 0x11, 1, 4, false, false, false}, {1, 0x12, 1, 4, true, false, false},
        {2, 0x14, 2, 4, true, true, true},    {4, 0x21, 1, 0, false, false, false},
        {5, 0x31, 1, 0, false, false, false}, {6, 0x41, 2, 4, false, false, false},
        {8, 0x52, 2, 4, true, false, false},  {10, 0x54, 2, 4, true, false, true},
        {12, 0x15, 2, 4, true, true, true},
    };
    struct rig rig;
    struct ppmc_board_info boards[PPMC_SLOTS];
    struct hm2_diag diag = {0};
    rig_new(&rig, NULL);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        rig_add(&rig, rows[i].slot, rows[i].id);
    struct epp *const epp = sim_ppmc_epp(rig.bus);
    assert_int_equal(ppmc_scan(epp, boards, &diag), 0);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct ppmc_board_info *const found = &boards[rows[i].slot];
        assert_int_equal(found->id, rows[i].id);
        assert_int_equal(found->slots, rows[i].slots);
        assert_int_equal(found->encoders, rows[i].encoders);
        assert_int_equal(found->index, rows[i].index);
        assert_int_equal(found->filter, rows[i].filter);
        assert_int_equal(found->timestamps, rows[i].timestamps);
    }
    assert_int_equal(boards[14].id, 0);
    epp_close(epp);
    rig_free(&rig);
}

static void what_is_no_board_is_refused_with_its_slot_and_byte(void **state)
{
    (void)state;
    static const struct {
        unsigned slot;
        uint8_t id;
        const char *said;
    } rows[] = {{2, 0x66, "Slot 2: the ID 0x66"}, {5, 0x14, "Slot 5: the ID 0x14"}, {7, 0x41, "Slot 7: the ID 0x41"}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct rig rig;
        struct hm2_diag diag = {0};
        rig_new(&rig, NULL);
        rig_add(&rig, rows[i].slot, 0x11);
        sim_ppmc_set_id(rig.bus, rows[i].slot, rows[i].id);
        assert_int_equal(rig_setup(&rig, &diag), HM2_ERR_MISMATCH);
        assert_non_null(strstr(diag.text, rows[i].said));
        rig_free(&rig);
    }
}

static void an_id_that_changes_is_refused(void **state)
{
    (void)state;
    struct rig rig;
    struct hm2_diag diag = {0};
    rig_new(&rig, NULL);
    rig_add(&rig, 0, 0x14);
    sim_ppmc_fault_at(rig.bus, 3, 1, SIM_PPMC_FAULT_RESIDUE); /* the second look */
    assert_int_equal(rig_setup(&rig, &diag), HM2_ERR_MISMATCH);
    assert_non_null(strstr(diag.text, "Slot 0: its ID reads as 0x14, then 0x0F"));
    rig_free(&rig);
}

static void version_15_is_an_empty_slot_and_an_empty_bus_is_an_error(void **state)
{
    (void)state;
    struct rig rig;
    struct hm2_diag diag = {0};
    rig_new(&rig, NULL);
    rig_add(&rig, 0, 0x11);
    sim_ppmc_set_id(rig.bus, 0, 0x1F);
    assert_int_equal(rig_setup(&rig, &diag), HM2_ERR_NOTFOUND);
    rig_free(&rig);
}

static void options_that_a_board_cannot_do_are_errors(void **state)
{
    (void)state;
    struct rig rig;
    struct hm2_diag diag = {0};
    rig_new(&rig, NULL);
    rig_add(&rig, 3, 0x12);
    rig.options.timestamps = 1u << 3;
    rig.options.filter[3] = PPMC_5_MHZ;
    rig.options.expected = 1u << 4 | 1u << 3;
    assert_true(rig_setup(&rig, &diag) < 0);
    assert_int_equal(diag.problems, 3);
    assert_non_null(strstr(diag.text, "Slot 4: a board with encoders is expected"));
    rig_free(&rig);
}

static void the_filter_rate_is_written_by_its_code(void **state)
{
    (void)state;
    struct rig rig;
    struct hm2_diag diag = {0};
    rig_new(&rig, NULL);
    rig_add(&rig, 2, 0x14);
    rig_add(&rig, 4, 0x12);
    struct epp *const epp = sim_ppmc_epp(rig.bus);
    for (unsigned code = 0; code < PPMC_FILTERS; code++) {
        assert_int_equal(ppmc_set_filter(epp, 2, (enum ppmc_filter)code, &diag), 0);
        assert_int_equal(sim_ppmc_registers(rig.bus, 2).filter, code);
    }
    assert_int_equal(ppmc_set_filter(epp, 4, PPMC_1_MHZ, &diag), HM2_ERR_UNSUPPORTED);
    assert_int_equal(ppmc_set_filter(epp, 6, PPMC_1_MHZ, &diag), HM2_ERR_NOTFOUND);
    assert_int_equal(ppmc_set_filter(epp, 16, PPMC_1_MHZ, &diag), HM2_ERR_RANGE);
    epp_close(epp);
    rig_free(&rig);
}

/* ---- counts -------------------------------------------------------------------------------------------------------
 */

/* ppmc.md section 11.7 */
static const struct {
    const char *name;
    uint32_t before, after;
    int32_t delta;
} readings[] = {
    {"zero", 0, 0, 0},
    {"plus one", 0, 1, 1},
    {"minus one", 0, 0xFFFFFF, -1},
    {"up through zero", 0xFFFFFE, 3, 5},
    {"down through zero", 2, 0xFFFFFC, -6},
    {"up through the sign", 0x7FFFFF, 0x800001, 2},
    {"down through the sign", 0x800000, 0x7FFFFE, -2},
    {"fast through zero", 0xFE0000, 0x020000, 262144},
    {"the longest way up", 0, 0x7FFFFF, 8388607},
    {"the longest way down", 0, 0x800001, -8388607},
};

static void reading_is_extended(const size_t row, const unsigned axis)
{
    struct watch watch;
    struct rig rig;
    rig_two(&rig, NULL);
    rig_start(&rig);
    watch_all(&watch, &rig, 4);
    for (unsigned i = 0; i < 4; i++) /* the others stay away from 0 */
        sim_ppmc_set_counter(rig.bus, 2, i, i == axis ? readings[row].before : 1000000);
    cycle(&rig);
    const int32_t before = *watch.count[axis];
    sim_ppmc_set_counter(rig.bus, 2, axis, readings[row].after);
    rig.next_ns += INT64_C(1000000000); /* time for the way */
    cycle(&rig);
    for (unsigned i = 0; i < 4; i++) {
        const int32_t wanted = i == axis ? readings[row].delta : 0;
        if (*watch.delta[i] != wanted || (i == axis && *watch.count[i] - before != wanted))
            fail_msg("%s on axis %u: delta of axis %u is %d, wanted %d", readings[row].name, axis, i, *watch.delta[i],
                     wanted);
    }
    rig_free(&rig);
}

static void readings_of_each_axis_are_extended_by_their_modular_difference(void **state)
{
    (void)state;
    for (size_t row = 0; row < sizeof readings / sizeof readings[0]; row++)
        for (unsigned axis = 0; axis < 4; axis++)
            reading_is_extended(row, axis);
}

static void position_goes_on_where_count_wraps(void **state)
{
    (void)state;
    struct rig rig;
    rig_two(&rig, NULL);
    rig_start(&rig);
    set(&rig, "encoder.00.scale", -2);
    turn(&rig, 0, 10000000);
    for (unsigned i = 0; i < 500; i++) { /* half a second each: less than half of what 24 bits hold */
        rig.next_ns += INT64_C(499000000);
        cycle(&rig);
    }
    assert_true(held(&rig, 0) > INT64_C(2400000000));
    assert_true(get(&rig, "encoder.00.count") == (double)(int32_t)held(&rig, 0));
    assert_true(get(&rig, "encoder.00.position") == (double)held(&rig, 0) / -2);
    rig_free(&rig);
}

/* Rates for each of eight encoders, up to the filter's limit, changing every few thousand cycles. */
static int32_t rate_of(const unsigned phase, const unsigned encoder)
{
    static const int32_t rates[] = {0,       1,       37,       1000,    -12345,   100000,
                                    -999999, 2500000, -5000000, 9999999, 10000000, -10000000};
    return rates[(phase + 5 * encoder) % (sizeof rates / sizeof rates[0])];
}

static void a_million_cycles_at_all_rates_miss_no_count(void **state)
{
    (void)state;
    const unsigned total = TOTAL_CYCLES, phase = 25000;
    struct watch watch;
    struct rig rig;
    rig_two(&rig, NULL);
    rig_start(&rig);
    watch_all(&watch, &rig, 8);
    for (unsigned n = 0; n < total; n++) {
        if (n % phase == 0)
            for (unsigned i = 0; i < 8; i++)
                turn(&rig, i, rate_of(n / phase, i));
        cycle(&rig);
        for (unsigned i = 0; i < 8; i++)
            if (*watch.count[i] != (int32_t)held(&rig, i) || *watch.fault)
                fail_msg("cycle %u, encoder %u: count %d, true is %" PRId64, n, i, *watch.count[i], held(&rig, i));
    }
    for (unsigned i = 0; i < 8; i++)
        assert_int_equal(sim_ppmc_truth(rig.bus, slot_of(i), i % 4).illegal, 0);
    assert_true(get(&rig, "timeouts") == 0 && get(&rig, "bad-data") == 0 && get(&rig, "retries") == 0);
    rig_free(&rig);
}

/* ---- faults ------------------------------------------------------------------------------------------------------ */

/* What an encoder shows is true, or what it showed before while `fault` says so. */
static void check_shown(struct rig *const rig, const struct watch *const watch, const unsigned i, const int32_t before,
                        const double rate)
{
    const int32_t count = *watch->count[i];
    const bool steady = rate <= 10e6; /* else it is about to change */
    if (count != (int32_t)held(rig, i) && !(*watch->fault && count == before))
        fail_msg("encoder %u: count %d, true is %" PRId64, i, count, held(rig, i));
    if (*watch->delta[i] != count - before)
        fail_msg("encoder %u: delta %d, from %d to %d", i, *watch->delta[i], before, count);
    if ((int32_t)(int64_t)*watch->position[i] != count)
        fail_msg("encoder %u: position %.1f at count %d", i, *watch->position[i], count);
    /* A pulse that is tried again comes some time-outs later. */
    if (steady && fabs(*watch->velocity[i] - rate) > 2000 + 0.15 * fabs(rate))
        fail_msg("encoder %u: velocity %.1f, true is %.1f", i, *watch->velocity[i], rate);
}

static void faults(const unsigned mask, const bool must_fail)
{
    struct watch watch;
    struct rig rig;
    unsigned bad = 0;
    int32_t shown[8] = {0};
    rig_two(&rig, &(struct sim_ppmc_options){.seed = mask});
    rig_start(&rig);
    watch_all(&watch, &rig, 8);
    sim_ppmc_set_faults(rig.bus, 1000, mask);
    for (unsigned n = 0; n < 50000; n++) {
        if (n % 2000 == 0)
            for (unsigned i = 0; i < 8; i++)
                turn(&rig, i, rate_of(n / 2000, i));
        cycle(&rig);
        bad += *watch.fault;
        for (unsigned i = 0; i < 8; i++) {
            /* The byte before the index sense register may look like indices, and that register reads only once. */
            if (*watch.index[i] && !(mask >> SIM_PPMC_FAULT_RESIDUE & 1u))
                fail_msg("cycle %u, encoder %u: an index that is not there", n, i);
            check_shown(&rig, &watch, i, shown[i], n % 2000 > 5 ? (double)rate_of(n / 2000, i) : HUGE_VAL);
            shown[i] = *watch.count[i];
        }
    }
    const struct sim_ppmc_stats stats = sim_ppmc_stats(rig.bus);
    const double counted = get(&rig, "timeouts") + get(&rig, "bad-data");
    uint64_t injected = 0;
    for (unsigned i = 0; i < SIM_PPMC_FAULTS; i++)
        injected += stats.faults[i];
    assert_true(injected > 3000);
    assert_true(get(&rig, "timeouts") == (double)stats.faults[SIM_PPMC_FAULT_TIMEOUT]);
    assert_true(counted > 0 && get(&rig, "retries") > 0);
    assert_true(get(&rig, "board.02.position-lost") == 0 && get(&rig, "board.04.position-lost") == 0);
    assert_true(bad < 2000 && (!must_fail || bad > 0));
    rig_free(&rig);
}

static void timeouts_in_one_of_a_thousand_cycles_show_no_wrong_count(void **state)
{
    (void)state;
    faults(1u << SIM_PPMC_FAULT_TIMEOUT, true);
}

static void stuck_data_in_one_of_a_thousand_cycles_shows_no_wrong_count(void **state)
{
    (void)state;
    faults(FAULTS_ON_READS, false);
}

static void shifted_data_in_one_of_a_thousand_cycles_shows_no_wrong_count(void **state)
{
    (void)state;
    faults(ALL_FAULTS & ~(1u << SIM_PPMC_FAULT_RESIDUE), true);
}

static void all_faults_in_one_of_a_thousand_cycles_show_no_wrong_count(void **state)
{
    (void)state;
    faults(ALL_FAULTS, true);
}

/* One period of one board, bus cycle by bus cycle: the latch pulse, the block with the ID at its end, the counts once
 * more, and the armed indices. */
enum { PULSE_END = 6, BLOCK = 7, BLOCK_END = BLOCK + 16, AGAIN = BLOCK_END + 1, AGAIN_END = AGAIN + 12, PERIOD = 38 };

/* Does a fault of a bus cycle bring other bytes than there are, where every count byte differs from 0x00, 0xFF and the
 * one before? Registers 13 and 14 are not used, and nothing depends on the address behind the last byte of a block. */
static bool does_harm(const unsigned cycle_number, const enum sim_ppmc_fault fault)
{
    const bool in_block = cycle_number >= BLOCK && cycle_number < BLOCK_END;
    const bool again = cycle_number >= AGAIN && cycle_number < AGAIN_END;
    const unsigned offset = cycle_number - (in_block ? BLOCK : AGAIN);
    if (fault == SIM_PPMC_FAULT_TIMEOUT)
        return true;
    if (!in_block && !again)
        return false;
    if (fault == SIM_PPMC_FAULT_SKIP || fault == SIM_PPMC_FAULT_REPEAT)
        return offset != (in_block ? 15 : 11);
    return offset < 12 || offset == 15 || (offset == 12 && fault != SIM_PPMC_FAULT_ZEROS);
}

static void every_single_fault_of_a_period_is_counted_and_shows_no_wrong_value(void **state)
{
    (void)state;
    struct watch watch;
    struct rig rig;
    int32_t shown[4];
    rig_new(&rig, NULL);
    rig_add(&rig, 2, 0x14);
    rig.options.filter[2] = PPMC_10_MHZ;
    rig_start(&rig);
    watch_all(&watch, &rig, 4);
    for (unsigned i = 0; i < 4; i++)
        sim_ppmc_set_counter(rig.bus, 2, i, 0x123456 + 0x111111 * i);
    rig.next_ns += INT64_C(1000000000); /* time for the way */
    cycles(&rig, 2);
    for (unsigned fault = 0; fault < SIM_PPMC_FAULTS; fault++)
        for (unsigned k = 0; k < PERIOD; k++) {
            const double counted = get(&rig, fault == SIM_PPMC_FAULT_TIMEOUT ? "timeouts" : "bad-data");
            const double retries = get(&rig, "retries"), harm = does_harm(k, (enum sim_ppmc_fault)fault);
            for (unsigned i = 0; i < 4; i++)
                shown[i] = *watch.count[i];
            sim_ppmc_fault_at(rig.bus, k, 1, (enum sim_ppmc_fault)fault);
            cycle(&rig);
            for (unsigned i = 0; i < 4; i++)
                if (*watch.count[i] != shown[i] || *watch.position[i] != shown[i] || *watch.delta[i] != 0 ||
                    *watch.velocity[i] != 0 || *watch.index[i])
                    fail_msg("fault %u in cycle %u: encoder %u shows %d", fault, k, i, *watch.count[i]);
            if (get(&rig, fault == SIM_PPMC_FAULT_TIMEOUT ? "timeouts" : "bad-data") != counted + harm ||
                get(&rig, "retries") != retries + harm || *watch.fault)
                fail_msg("fault %u in cycle %u is not counted as it should be", fault, k);
        }
    rig_free(&rig);
}

static void after_a_period_without_data_the_velocity_is_that_of_two(void **state)
{
    (void)state;
    struct rig rig;
    rig_two(&rig, NULL);
    rig_start(&rig);
    turn(&rig, 0, 1000000);
    cycles(&rig, 5);
    for (unsigned lost = 1; lost < 4; lost++) {
        sim_ppmc_unplug(rig.bus, true);
        cycles(&rig, lost);
        sim_ppmc_unplug(rig.bus, false);
        cycle(&rig);
        if (fabs(get(&rig, "encoder.00.velocity") - 1000000) > 150000)
            fail_msg("%u periods lost: velocity %.0f", lost, get(&rig, "encoder.00.velocity"));
        cycles(&rig, 3);
    }
    rig_free(&rig);
}

static bool has_message(struct rig *const rig, const char *const part)
{
    char text[512];
    bool error, found = false;
    while (ppmc_next_message(rig->ppmc, text, sizeof text, &error) > 0)
        found = found || strstr(text, part) != NULL;
    return found;
}

static void a_pulled_cable_holds_all_values_and_comes_back(void **state)
{
    (void)state;
    struct rig rig;
    rig_two(&rig, NULL);
    rig_start(&rig);
    turn(&rig, 0, 100000);
    cycles(&rig, 100);
    const double before = get(&rig, "encoder.00.count");
    sim_ppmc_unplug(rig.bus, true);
    for (unsigned i = 0; i < 20; i++) {
        const int64_t start_ns = rig.next_ns;
        cycle(&rig);
        assert_true(sim_ppmc_now_ns(rig.bus) - start_ns < 100000); /* a dead bus costs little */
    }
    assert_true(get(&rig, "encoder.00.count") == before && get(&rig, "encoder.00.delta") == 0);
    assert_true(get(&rig, "encoder.00.velocity") == 0);
    assert_true(get(&rig, "fault") == 1 && get(&rig, "board.02.online") == 0);
    assert_true(get(&rig, "board.04.failures") == 20);
    assert_true(has_message(&rig, "slot 2 gives no usable data"));
    sim_ppmc_unplug(rig.bus, false);
    cycles(&rig, 2);
    assert_true(get(&rig, "encoder.00.count") == (double)held(&rig, 0));
    assert_true(get(&rig, "fault") == 0 && get(&rig, "board.02.online") == 1);
    assert_true(get(&rig, "board.02.position-lost") == 0); /* too short for a loss of power */
    assert_true(has_message(&rig, "slot 4 is back"));
    rig_free(&rig);
}

static void a_board_that_lost_its_power_is_set_up_again_and_its_position_does_not_move(void **state)
{
    (void)state;
    struct rig rig;
    rig_two(&rig, NULL);
    rig_start(&rig);
    turn(&rig, 5, 100000);
    cycles(&rig, 100);
    turn(&rig, 5, 0);
    cycles(&rig, 2);
    const double before = get(&rig, "encoder.05.count");
    sim_ppmc_power(rig.bus, 4, false);
    cycles(&rig, 200);
    sim_ppmc_power(rig.bus, 4, true);
    cycles(&rig, 10);
    assert_true(before > 9000 && get(&rig, "encoder.05.count") == before);
    assert_true(get(&rig, "board.04.position-lost") == 1 && get(&rig, "board.04.online") == 1);
    assert_true(get(&rig, "board.02.position-lost") == 0 && get(&rig, "fault") == 0);
    assert_int_equal(sim_ppmc_registers(rig.bus, 4).filter, PPMC_10_MHZ);
    assert_true(has_message(&rig, "its counters may have been reset"));
    set(&rig, "board.04.position-lost", 0);
    turn(&rig, 5, 100000);
    cycles(&rig, 100);
    assert_true(get(&rig, "encoder.05.count") > before + 9000);
    assert_true(get(&rig, "board.04.position-lost") == 0);
    rig_free(&rig);
}

/* A counter of 24 bits: at the filter's limit it goes half its way round in 0.84 s. */
static void a_move_while_nobody_looked_for_too_long_is_not_trusted(void **state)
{
    (void)state;
    static const struct {
        int64_t gap_ns;
        int32_t rate;
        bool lost;
    } rows[] = {{800000000, 9000000, false},
                {850000000, 9900000, true},
                {INT64_C(20000000000), 1, true},
                {INT64_C(20000000000), 0, false}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct rig rig;
        rig_two(&rig, NULL);
        rig_start(&rig);
        rig.next_ns += INT64_C(60000000000); /* before the first reading there is nothing to lose */
        turn(&rig, 4, 0);
        cycles(&rig, 5);
        turn(&rig, 4, rows[i].rate);
        rig.next_ns += rows[i].gap_ns;
        cycles(&rig, 2);
        if ((get(&rig, "board.04.position-lost") != 0) != rows[i].lost || get(&rig, "board.02.position-lost") != 0)
            fail_msg("row %zu: position-lost is %.0f", i, get(&rig, "board.04.position-lost"));
        if (!rows[i].lost)
            assert_true(get(&rig, "encoder.04.count") == (double)held(&rig, 4));
        rig_free(&rig);
    }
}

static void a_reset_in_mid_run_is_noticed(void **state)
{
    (void)state;
    struct rig rig;
    rig_two(&rig, NULL);
    rig_start(&rig);
    sim_ppmc_set_counter(rig.bus, 2, 3, 500);
    cycles(&rig, 10);
    sim_ppmc_reset(rig.bus);
    cycles(&rig, 10);
    assert_true(get(&rig, "encoder.03.count") == 500);
    assert_true(get(&rig, "board.02.position-lost") == 1 && get(&rig, "fault") == 0);
    assert_int_equal(sim_ppmc_registers(rig.bus, 2).filter, PPMC_10_MHZ);
    rig_free(&rig);
}

static void another_board_in_the_slot_is_not_read(void **state)
{
    (void)state;
    struct rig rig;
    rig_two(&rig, NULL);
    rig_start(&rig);
    sim_ppmc_set_id(rig.bus, 4, 0x15);
    turn(&rig, 6, 1000000);
    cycles(&rig, 10);
    assert_true(get(&rig, "encoder.06.count") == 0 && get(&rig, "board.04.online") == 0);
    assert_true(get(&rig, "bad-data") > 0);
    rig_free(&rig);
}

/* ---- index ------------------------------------------------------------------------------------------------------- */

static void the_index_presets_exactly_at_every_speed(void **state)
{
    (void)state;
    static const int32_t speeds[] = {1000, -1000, 77777, -333333, 1000000, -5000000, 9000000, 10000000};
    for (size_t s = 0; s < sizeof speeds / sizeof speeds[0]; s++) {
        struct watch watch;
        struct rig rig;
        rig_two(&rig, NULL);
        rig_start(&rig);
        watch_all(&watch, &rig, 8);
        const int64_t turn_counts = labs(speeds[s]) / 50 + 100, offset = turn_counts / 3;
        sim_ppmc_set_index(rig.bus, 4, 2, (uint32_t)turn_counts, (uint32_t)offset, 4);
        turn(&rig, 6, speeds[s]);
        for (unsigned round = 0; round < 50; round++) {
            unsigned seen = 0, waited = 0;
            cycles(&rig, 7);
            *watch.index_enable[6] = true;
            for (; *watch.index_enable[6] && waited < 200; waited++) {
                cycle(&rig);
                seen += *watch.index[6] && !*watch.index_enable[6];
            }
            const struct sim_ppmc_truth truth = sim_ppmc_truth(rig.bus, 4, 2);
            if (waited == 200 || seen != 1 || *watch.count[6] != (int32_t)(truth.held_counted - truth.preset_at) ||
                *watch.delta[6] != *watch.count[6])
                fail_msg("%d counts/s, round %u: count %d, since the index %" PRId64 ", announced %u times", speeds[s],
                         round, *watch.count[6], truth.held_counted - truth.preset_at, seen);
            if ((truth.preset_at - offset - (speeds[s] > 0 ? 0 : 3)) % turn_counts != 0)
                fail_msg("%d counts/s: preset at %" PRId64 ", offset %" PRId64 " turn %" PRId64, speeds[s],
                         truth.preset_at, offset, turn_counts);
            cycle(&rig);
            assert_int_equal(sim_ppmc_registers(rig.bus, 4).preset, 0);
        }
        rig_free(&rig);
    }
}

static void an_index_before_it_is_armed_is_not_the_one(void **state)
{
    (void)state;
    struct rig rig;
    rig_two(&rig, NULL);
    rig_start(&rig);
    sim_ppmc_set_index(rig.bus, 2, 0, 10000, 50, 4);
    turn(&rig, 0, 100000);
    cycles(&rig, 1);
    set(&rig, "encoder.00.index-enable", 1); /* the sense register has the index of count 50 when it is armed */
    cycles(&rig, 20);
    assert_true(get(&rig, "encoder.00.index-enable") == 1);
    assert_true(get(&rig, "encoder.00.count") == (double)held(&rig, 0));
    cycles(&rig, 90);
    assert_true(get(&rig, "encoder.00.index-enable") == 0);
    assert_int_equal(sim_ppmc_truth(rig.bus, 2, 0).presets, 1);
    rig_free(&rig);
}

static void the_index_is_exact_while_cycles_fail(void **state)
{
    (void)state;
    struct watch watch;
    struct rig rig;
    rig_two(&rig, NULL);
    rig_start(&rig);
    watch_all(&watch, &rig, 8);
    sim_ppmc_set_index(rig.bus, 2, 1, 50000, 12345, 4);
    turn(&rig, 1, 2000000);
    cycles(&rig, 3);
    sim_ppmc_set_faults(rig.bus, 200, 1u << SIM_PPMC_FAULT_TIMEOUT | 1u << SIM_PPMC_FAULT_ONES);
    for (unsigned round = 0; round < 500; round++) {
        unsigned waited = 0;
        *watch.index_enable[1] = true;
        while (*watch.index_enable[1] && waited++ < 1000)
            cycle(&rig);
        const struct sim_ppmc_truth truth = sim_ppmc_truth(rig.bus, 2, 1);
        if (waited > 30 || *watch.count[1] != (int32_t)(truth.held_counted - truth.preset_at))
            fail_msg("round %u: count %d, since the index %" PRId64 ", after %u cycles", round, *watch.count[1],
                     truth.held_counted - truth.preset_at, waited);
        cycles(&rig, 10);
    }
    rig_free(&rig);
}

static void the_speed_stays_over_an_index(void **state)
{
    (void)state;
    struct watch watch;
    struct rig rig;
    rig_two(&rig, NULL);
    rig_start(&rig);
    watch_all(&watch, &rig, 8);
    sim_ppmc_set_index(rig.bus, 2, 0, 50000, 4321, 4);
    turn(&rig, 0, 500000);
    cycles(&rig, 3);
    *watch.index_enable[0] = true;
    for (unsigned i = 0; i < 300; i++) {
        cycle(&rig);
        assert_true(fabs(*watch.velocity[0] - 500000) < 50000);
    }
    assert_false(*watch.index_enable[0]);
    rig_free(&rig);
}

/* ---- velocity -----------------------------------------------------------------------------------------------------
 */

static void velocities_by_timestamps_are_good_to_a_thousandth_and_stop_at_once(void **state)
{
    (void)state;
    for (unsigned live = 0; live < 2; live++)
        for (int32_t rate = 50; rate <= 200000; rate *= 4) {
            struct watch watch;
            struct rig rig;
            rig_two(&rig, &(struct sim_ppmc_options){.timestamps_live = live != 0});
            rig.options.timestamps = 1u << 2;
            rig_start(&rig);
            watch_all(&watch, &rig, 4);
            turn(&rig, 3, rate);
            cycles(&rig, 200);
            for (unsigned i = 0; i < 1000; i++) {
                cycle(&rig);
                /* A live timestamp may be of the count after the one that was latched. */
                const double tolerance = live ? 0.5 : rate < 16000 ? 0.002 : 0.05;
                if (fabs(*watch.velocity[3] - rate) > tolerance * rate)
                    fail_msg("velocity %.3f at %d counts/s", *watch.velocity[3], rate);
            }
            turn(&rig, 3, 0);
            cycles(&rig, 68);
            if (*watch.velocity[3] != 0)
                fail_msg("velocity %.3f at rest after %d counts/s", *watch.velocity[3], rate);
            rig_free(&rig);
        }
}

static void dithering_on_an_edge_is_no_motion(void **state)
{
    (void)state;
    struct rig rig;
    rig_two(&rig, NULL);
    rig.options.timestamps = 1u << 2;
    rig_start(&rig);
    cycles(&rig, 3);
    for (unsigned i = 0; i < 100; i++) {
        sim_ppmc_jump(rig.bus, 2, 0, i % 2 ? -1 : 1);
        cycle(&rig);
        if (i > 0)
            assert_true(get(&rig, "encoder.00.velocity") == 0);
    }
    rig_free(&rig);
}

static void a_scale_that_is_none_becomes_one_before_it_is_used(void **state)
{
    (void)state;
    static const struct {
        double given, used;
    } rows[] = {{0, 1}, {1e-30, 1}, {-1e-30, -1}, {NAN, 1}, {INFINITY, 1}, {-4, -4}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct rig rig;
        rig_two(&rig, NULL);
        rig_start(&rig);
        set(&rig, "encoder.00.scale", rows[i].given);
        turn(&rig, 0, 10000);
        cycles(&rig, 2);
        assert_true(get(&rig, "encoder.00.scale") == rows[i].used);
        assert_true(get(&rig, "encoder.00.position") == (double)held(&rig, 0) / rows[i].used);
        rig_free(&rig);
    }
}

/* ---- the bus ------------------------------------------------------------------------------------------------------
 */

static void one_period_takes_the_documented_cycles(void **state)
{
    (void)state;
    static const struct {
        bool verify, timestamps;
        unsigned cycles;
    } rows[] = {{false, false, 25}, {true, false, 38}, {false, true, 36}, {true, true, 60}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct rig rig;
        rig_new(&rig, NULL);
        rig_add(&rig, 2, 0x14);
        rig.options.verify = rows[i].verify;
        rig.options.timestamps = rows[i].timestamps ? 1u << 2 : 0;
        rig_start(&rig);
        const uint64_t before = sim_ppmc_stats(rig.bus).cycles;
        cycle(&rig);
        assert_int_equal(sim_ppmc_stats(rig.bus).cycles - before, rows[i].cycles);
        assert_int_equal(sim_ppmc_stats(rig.bus).undocumented, 0);
        rig_free(&rig);
    }
}

/* A bus that writes down what it is told: address A20, written bytes W00, read ones as R16. */
struct recorder {
    struct epp base, *bus;
    char text[4096];
};

static void record(struct recorder *const recorder, const struct epp_step *const step)
{
    const bool address = step->kind == EPP_ADDRESS_WRITE;
    for (unsigned i = 0; i < step->len; i++) {
        const size_t used = strlen(recorder->text), left = sizeof recorder->text - used;
        if (step->kind == EPP_DATA_READ) {
            (void)snprintf(recorder->text + used, left, " R%u", step->len);
            return;
        }
        (void)snprintf(recorder->text + used, left, " %c%02X", address ? 'A' : 'W', step->data[i]);
    }
}

static int recorder_run(struct epp *const epp, const struct epp_step *const steps, const size_t count,
                        struct epp_done *const done)
{
    struct recorder *const recorder = (struct recorder *)epp;
    const int err = epp_run(recorder->bus, steps, count, done);
    for (size_t i = 0; i < done->steps; i++)
        record(recorder, &steps[i]);
    return err;
}

static int64_t recorder_now(struct epp *const epp)
{
    return epp_now_ns(((struct recorder *)epp)->bus);
}

static void recorder_close(struct epp *const epp)
{
    epp_close(((struct recorder *)epp)->bus);
}

static void expect_recorded(struct recorder *const recorder, const char *const what, const char *const wanted)
{
    /* From where the first register was written on; before that it has looked for boards. */
    const char *const found = strstr(recorder->text, wanted);
    if (!found || found[strlen(wanted)] != '\0')
        fail_msg("%s: wanted%s, found%s", what, wanted, recorder->text);
    recorder->text[0] = '\0';
}

/* Every register that is written (seed 004), in set-up and in a period: control 3, timer 4, assembly 0 to 2, index
 * preset 13, filter rate 5. The first board of the bus is the master and gives the latch pulse. */
static void set_up_and_a_period_write_the_registers_that_the_board_has_for_it(void **state)
{
    (void)state;
    static const struct epp_ops ops = {.run = recorder_run, .now_ns = recorder_now, .close = recorder_close};
    static struct recorder recorder;
    struct hm2_diag diag = {0};
    struct rig rig;
    rig_two(&rig, NULL);
    rig.options.timestamps = 1u << 4;
    rig.options.filter[4] = PPMC_FILTER_KEEP;
    recorder = (struct recorder){.base.ops = &ops, .bus = sim_ppmc_epp(rig.bus)};
    assert_int_equal(ppmc_setup(rig.ppmc, &recorder.base, hm2_plain_binder(rig.plain), &rig.options, &diag), 0);
    rig.next_ns = sim_ppmc_now_ns(rig.bus) + PERIOD_NS;
    expect_recorded(&recorder, "set-up",
                    " A23 W00 A24 W10 A23 WF0 A20 W00 A21 W00 A22 W00 A23 WF0 A23 WF0 A23 W00 A2D W00 A25 W03"
                    " A43 W00 A44 W00 A43 WF0 A40 W00 A41 W00 A42 W00 A43 WF0 A43 WF0 A43 W00 A4D W00");
    cycle(&rig);
    expect_recorded(&recorder, "a period",
                    " A24 W20 A24 W20 A24 W00 A20 R16 A20 R12 A40 R16 A40 R12 A50 R10 A50 R10 A2D W00 A4D W00");
    set(&rig, "encoder.05.index-enable", 1);
    cycle(&rig);
    expect_recorded(&recorder, "arming", " A2D W00 A4C R1 A4D W02");
    ppmc_stop(rig.ppmc);
    expect_recorded(&recorder, "the end", " A2D W00 A4D W00");
    rig_free(&rig);
}

static void sixteen_boards_fit(void **state)
{
    (void)state;
    struct rig rig;
    rig_new(&rig, NULL);
    for (unsigned slot = 0; slot < 16; slot++)
        rig_add(&rig, slot, 0x12);
    rig_start(&rig);
    sim_ppmc_set_rate(rig.bus, 15, 3, 1000);
    cycles(&rig, 100);
    assert_true(get(&rig, "encoder.63.count") == (double)sim_ppmc_truth(rig.bus, 15, 3).held_counted);
    assert_true(get(&rig, "encoder.63.count") > 90);
    rig_free(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_scan_names_all_boards),
        cmocka_unit_test(what_is_no_board_is_refused_with_its_slot_and_byte),
        cmocka_unit_test(an_id_that_changes_is_refused),
        cmocka_unit_test(version_15_is_an_empty_slot_and_an_empty_bus_is_an_error),
        cmocka_unit_test(options_that_a_board_cannot_do_are_errors),
        cmocka_unit_test(the_filter_rate_is_written_by_its_code),
        cmocka_unit_test(readings_of_each_axis_are_extended_by_their_modular_difference),
        cmocka_unit_test(position_goes_on_where_count_wraps),
        cmocka_unit_test(a_million_cycles_at_all_rates_miss_no_count),
        cmocka_unit_test(timeouts_in_one_of_a_thousand_cycles_show_no_wrong_count),
        cmocka_unit_test(stuck_data_in_one_of_a_thousand_cycles_shows_no_wrong_count),
        cmocka_unit_test(shifted_data_in_one_of_a_thousand_cycles_shows_no_wrong_count),
        cmocka_unit_test(all_faults_in_one_of_a_thousand_cycles_show_no_wrong_count),
        cmocka_unit_test(every_single_fault_of_a_period_is_counted_and_shows_no_wrong_value),
        cmocka_unit_test(after_a_period_without_data_the_velocity_is_that_of_two),
        cmocka_unit_test(a_pulled_cable_holds_all_values_and_comes_back),
        cmocka_unit_test(a_board_that_lost_its_power_is_set_up_again_and_its_position_does_not_move),
        cmocka_unit_test(a_move_while_nobody_looked_for_too_long_is_not_trusted),
        cmocka_unit_test(a_reset_in_mid_run_is_noticed),
        cmocka_unit_test(another_board_in_the_slot_is_not_read),
        cmocka_unit_test(the_index_presets_exactly_at_every_speed),
        cmocka_unit_test(an_index_before_it_is_armed_is_not_the_one),
        cmocka_unit_test(the_index_is_exact_while_cycles_fail),
        cmocka_unit_test(the_speed_stays_over_an_index),
        cmocka_unit_test(velocities_by_timestamps_are_good_to_a_thousandth_and_stop_at_once),
        cmocka_unit_test(dithering_on_an_edge_is_no_motion),
        cmocka_unit_test(a_scale_that_is_none_becomes_one_before_it_is_used),
        cmocka_unit_test(one_period_takes_the_documented_cycles),
        cmocka_unit_test(set_up_and_a_period_write_the_registers_that_the_board_has_for_it),
        cmocka_unit_test(sixteen_boards_fit),
    };
    return cmocka_run_group_tests_name("PPMC", tests, NULL, NULL);
}
