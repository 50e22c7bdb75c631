/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* From a bus to boards that are ready to count (ppmc.md section 5). */
#include <stdio.h>
#include <stdlib.h>

#include "ppmc_private.h"

#define FASTEST_HZ 10e6 /* of the filter's four rates: what holds when nobody set one */
#define HZ_PER_MHZ 1e6

#define ENC(field, name, type, dir, init, unit, help) \
    HM2_POINT(struct ppmc_encoder, field, name, type, dir, init, unit, help)

static const struct hm2_point encoder_points[] = {
    ENC(position, "encoder.##.position", HM2_FLOAT, HM2_PIN_OUT, 0, "units", "counts divided by scale"),
    ENC(count, "encoder.##.count", HM2_S32, HM2_PIN_OUT, 0, "counts", "counts since the start or the last index"),
    ENC(delta, "encoder.##.delta", HM2_S32, HM2_PIN_OUT, 0, "counts",
        "change since the previous read; in the period of an index the counts since it"),
    ENC(velocity, "encoder.##.velocity", HM2_FLOAT, HM2_PIN_OUT, 0, "units/s",
        "by the board's timestamps where they are in use, else by the change of a period"),
    ENC(index, "encoder.##.index", HM2_BIT, HM2_PIN_OUT, 0, "", "the index was seen in the last period"),
    ENC(scale, "encoder.##.scale", HM2_FLOAT, HM2_PARAM_RW, 1, "counts/unit",
        "scale of position and velocity; one below 1e-20 becomes 1 or -1"),
};

static const struct hm2_point index_points[] = {
    ENC(index_enable, "encoder.##.index-enable", HM2_BIT, HM2_PIN_IO, 0, "",
        "1 arms the index; it presets the count to 0 and the pin becomes 0"),
};

static const struct hm2_point timestamp_points[] = {
    ENC(min_speed_estimate, "encoder.##.min-speed-estimate", HM2_FLOAT, HM2_PARAM_RW, 0, "units/s",
        "for compatibility with hal_ppmc; no effect in either"),
};

#define BOARD(field, name, type, dir, help) HM2_POINT(struct ppmc_board_pins, field, name, type, dir, 0, "", help)

static const struct hm2_point board_points[] = {
    BOARD(online, "board.##.online", HM2_BIT, HM2_PIN_OUT, "the board gives data; 0 after three periods without"),
    BOARD(failures, "board.##.failures", HM2_U32, HM2_PIN_OUT, "periods in which its data was not used"),
    BOARD(position_lost, "board.##.position-lost", HM2_BIT, HM2_PIN_IO,
          "its counters may have been reset: home again, then set it to 0"),
};

#define BUS(field, name, type, help) HM2_POINT(struct ppmc_bus_pins, field, name, type, HM2_PIN_OUT, 0, "", help)

static const struct hm2_point bus_points[] = {
    BUS(fault, "fault", HM2_BIT, "data of at least one board was not used in the last period"),
    BUS(timeouts, "timeouts", HM2_U32, "bus cycles that nobody answered"),
    BUS(io_errors, "io-errors", HM2_U32, "times that the system did not move bytes"),
    BUS(bad_data, "bad-data", HM2_U32, "readings that contradict themselves or are impossible"),
    BUS(retries, "retries", HM2_U32, "parts of a period that were tried once more"),
};

#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

const struct hm2_point_group *ppmc_point_groups(void)
{
    static const struct hm2_point_group groups[] = {
        {"", encoder_points, COUNT(encoder_points), NULL},
        {"", index_points, COUNT(index_points), "from firmware version 2 on"},
        {"", timestamp_points, COUNT(timestamp_points), "where the board's timestamps are in use"},
        {"", board_points, COUNT(board_points), "for each board with encoders, numbered by its slot"},
        {"", bus_points, COUNT(bus_points), NULL},
        {NULL, NULL, 0, NULL},
    };
    return groups;
}

struct ppmc_options ppmc_default_options(void)
{
    struct ppmc_options options = {.verify = true};
    for (unsigned i = 0; i < PPMC_SLOTS; i++)
        options.filter[i] = PPMC_FILTER_KEEP;
    return options;
}

struct ppmc *ppmc_new(void)
{
    return calloc(1, sizeof(struct ppmc));
}

void ppmc_free(struct ppmc *const ppmc)
{
    if (!ppmc)
        return;
    epp_close(ppmc->epp);
    free(ppmc);
}

const struct ppmc_board_info *ppmc_boards(const struct ppmc *const ppmc)
{
    return ppmc->infos;
}

/* ---- registers --------------------------------------------------------------------------------------------------- */

/* Counts 0 through the load path, which needs 2 us: the writes in between take longer. */
static int start_board(struct ppmc *const ppmc, struct ppmc_board *const board, struct hm2_diag *const diag)
{
    const struct ppmc_write writes[] = {
        {PPMC_W_CONTROL, 0},
        {PPMC_W_TIMER, board == ppmc->boards ? PPMC_MASTER : 0},
        {PPMC_W_CONTROL, PPMC_LOAD_ALL},
        {PPMC_W_ASSEMBLY, 0},
        {PPMC_W_ASSEMBLY + 1, 0},
        {PPMC_W_ASSEMBLY + 2, 0},
        {PPMC_W_CONTROL, PPMC_LOAD_ALL},
        {PPMC_W_CONTROL, PPMC_LOAD_ALL},
        {PPMC_W_CONTROL, 0},
        {PPMC_W_PRESET, 0},
        {PPMC_W_FILTER, board->filter},
    };
    const int err = ppmc->keep_counts
                        ? ppmc_restore(ppmc, board)
                        : ppmc_write_registers(ppmc, board, writes, COUNT(writes) - (board->sets_filter ? 0 : 1));
    if (err)
        return hm2_diag_add(diag, err, "Slot %u: the %s does not take its settings: %s.", board->slot, board->info.name,
                            hm2_strerror(err));
    board->online = true;
    board->good_ns = epp_now_ns(ppmc->epp);
    return 0;
}

/* ---- options ----------------------------------------------------------------------------------------------------- */

static int check_options(const struct ppmc *const ppmc, const struct ppmc_options *const options,
                         struct hm2_diag *const diag)
{
    int err = 0;
    for (unsigned i = 0; i < PPMC_SLOTS; i++) {
        const struct ppmc_board_info *const info = &ppmc->infos[i];
        const char *const found = info->id ? info->name : "no board";
        const bool filter = options->filter[i] < PPMC_FILTERS;
        if ((options->expected >> i & 1u) && info->encoders == 0)
            err = hm2_diag_add(diag, HM2_ERR_MISMATCH,
                               "Slot %u: a board with encoders is expected, %s was found. Check its power, cable and "
                               "address switches (on = 0, off = 1).",
                               i, found);
        if ((options->timestamps >> i & 1u) && !info->timestamps)
            err = hm2_diag_add(diag, HM2_ERR_UNSUPPORTED,
                               "Slot %u: timestamps are asked for, but %s (ID 0x%02X) has none; encoder boards have "
                               "them from 0x14 on.",
                               i, found, info->id);
        if (filter && !info->filter)
            err = hm2_diag_add(diag, HM2_ERR_UNSUPPORTED,
                               "Slot %u: an encoder filter rate is asked for, but %s (ID 0x%02X) cannot set one.", i,
                               found, info->id);
    }
    return err;
}

static void add_board(struct ppmc *const ppmc, const unsigned slot, const struct ppmc_options *const options)
{
    const enum ppmc_filter filter = options->filter[slot];
    struct ppmc_board *const board = &ppmc->boards[ppmc->board_count++];
    board->slot = slot;
    board->info = ppmc->infos[slot];
    board->sets_filter = filter < PPMC_FILTERS;
    board->filter = board->sets_filter ? (uint8_t)filter : 0;
    board->max_hz = board->sets_filter ? ppmc_filter_mhz(filter) * HZ_PER_MHZ : FASTEST_HZ;
    board->timestamps = options->timestamps >> slot & 1u;
    board->verify = options->verify;
    board->base = (uint8_t)(slot * PPMC_SLOT_ADDRESSES);
    board->stamps_at = (uint8_t)(board->base + PPMC_R_TIMESTAMPS);
    board->sense_at = (uint8_t)(board->base + PPMC_R_SENSE);
    board->preset_at = (uint8_t)(board->base + PPMC_W_PRESET);
}

static void find_boards(struct ppmc *const ppmc, const struct ppmc_options *const options, struct hm2_diag *const diag)
{
    for (unsigned slot = 0; slot < PPMC_SLOTS; slot++) {
        const struct ppmc_board_info *const info = &ppmc->infos[slot];
        if (info->encoders > 0)
            add_board(ppmc, slot, options);
        if (info->id != 0 && info->id >> 4 != 1)
            hm2_diag_warn(diag, "slot %u: %s (ID 0x%02X): %s", slot, info->name, info->id,
                          info->encoders ? "only its encoders are driven" : "it is not driven");
    }
}

/* ---- points ------------------------------------------------------------------------------------------------------ */

static void *take_memory(struct hm2_binder *const binder, const size_t size, struct hm2_diag *const diag)
{
    void *const memory = binder->alloc(binder, size);
    if (!memory)
        (void)hm2_diag_add(diag, HM2_ERR_NOMEM, "No memory for the points of a bus.");
    return memory;
}

/* index-enable is a pin where the board can preset, else memory that nobody sets. */
static int bind_index(const struct ppmc_board *const board, struct ppmc_encoder *const encoder,
                      struct hm2_binder *const binder, const char *const prefix, const unsigned number,
                      struct hm2_diag *const diag)
{
    if (board->info.index)
        return hm2_bind_points(binder, index_points, COUNT(index_points), encoder, prefix, number, diag);
    encoder->index_enable = take_memory(binder, sizeof *encoder->index_enable, diag);
    return encoder->index_enable ? 0 : HM2_ERR_NOMEM;
}

static int bind_encoder(const struct ppmc_board *const board, struct ppmc_encoder *const encoder,
                        struct hm2_binder *const binder, const char *const prefix, const unsigned number,
                        struct hm2_diag *const diag)
{
    int err = hm2_bind_points(binder, encoder_points, COUNT(encoder_points), encoder, prefix, number, diag);
    if (err == 0)
        err = bind_index(board, encoder, binder, prefix, number, diag);
    if (err == 0 && board->timestamps)
        err = hm2_bind_points(binder, timestamp_points, COUNT(timestamp_points), encoder, prefix, number, diag);
    return err;
}

static int bind_board(struct ppmc_board *const board, struct hm2_binder *const binder, const char *const prefix,
                      const unsigned first, struct hm2_diag *const diag)
{
    board->encoders = take_memory(binder, PPMC_AXES * sizeof *board->encoders, diag);
    board->pins = take_memory(binder, sizeof *board->pins, diag);
    if (!board->encoders || !board->pins)
        return HM2_ERR_NOMEM;
    int err = hm2_bind_points(binder, board_points, COUNT(board_points), board->pins, prefix, board->slot, diag);
    for (unsigned i = 0; err == 0 && i < PPMC_AXES; i++)
        err = bind_encoder(board, &board->encoders[i], binder, prefix, first + i, diag);
    return err;
}

static int bind_all(struct ppmc *const ppmc, struct hm2_binder *const binder, struct hm2_diag *const diag)
{
    char prefix[HM2_NAME_SIZE];
    (void)snprintf(prefix, sizeof prefix, "ppmc.%u", ppmc->bus);
    ppmc->pins = take_memory(binder, sizeof *ppmc->pins, diag);
    if (!ppmc->pins)
        return HM2_ERR_NOMEM;
    int err = hm2_bind_points(binder, bus_points, COUNT(bus_points), ppmc->pins, prefix, 0, diag);
    for (unsigned i = 0; err == 0 && i < ppmc->board_count; i++)
        err = bind_board(&ppmc->boards[i], binder, prefix, i * PPMC_AXES, diag);
    return err;
}

int ppmc_setup(struct ppmc *const ppmc, struct epp *const epp, struct hm2_binder *const binder,
               const struct ppmc_options *const options, struct hm2_diag *const diag)
{
    ppmc->epp = epp;
    ppmc->bus = options->bus;
    ppmc->keep_counts = options->keep_counts;
    int err = ppmc_scan(epp, ppmc->infos, diag);
    if (err == 0)
        err = check_options(ppmc, options, diag);
    if (err)
        return err;
    find_boards(ppmc, options, diag);
    if (ppmc->board_count == 0)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND,
                            "No board with encoders answers. Check power and cable of the boards, and that the port is "
                            "in EPP mode (EPP 1.9 in the computer's firmware set-up).");
    ppmc->timer_at = (uint8_t)(ppmc->boards[0].base + PPMC_W_TIMER);
    ppmc->pulse = PPMC_SOFT_LATCH;
    ppmc_plan(ppmc);
    err = bind_all(ppmc, binder, diag);
    for (unsigned i = 0; err == 0 && i < ppmc->board_count; i++)
        err = start_board(ppmc, &ppmc->boards[i], diag);
    return err;
}

void ppmc_stop(struct ppmc *const ppmc)
{
    static const struct ppmc_write disarm = {PPMC_W_PRESET, 0};
    for (unsigned i = 0; i < ppmc->board_count; i++)
        if (ppmc->boards[i].online)
            (void)ppmc_write_registers(ppmc, &ppmc->boards[i], &disarm, 1);
}
