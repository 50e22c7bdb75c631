/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "servo_rig.h"

int servo_set_up_card(void **state, const struct sim_card_options *const options)
{
    struct servo_rig *const f = calloc(1, sizeof *f);
    assert_non_null(f);
    if (sim_card_new(&f->card, options, &f->diag) != 0)
        fail_msg("%s", f->diag.text);
    assert_int_equal(sim_net_new(&f->net, f->card, NULL), 0);
    f->link = sim_net_link(f->net);
    f->board = hm2_board_new();
    f->plain = hm2_plain_binder_new();
    assert_non_null(f->board);
    assert_non_null(f->plain);
    f->period_ns = PERIOD_NS;
    f->work_ns = WORK_NS;
    *state = f;
    return 0;
}

int servo_set_up(void **state)
{
    return servo_set_up_card(state, &(struct sim_card_options){.profile = "7i96s", .seed = 1});
}

int servo_tear_down(void **state)
{
    struct servo_rig *const f = *state;
    hm2_board_free(f->board);
    hm2_plain_binder_free(f->plain);
    sim_net_free(f->net);
    sim_card_free(f->card);
    free(f);
    return 0;
}

double servo_get(const struct servo_rig *const f, const char *const name)
{
    char full[128];
    int err;
    (void)snprintf(full, sizeof full, PREFIX "%s", name);
    const double value = hm2_plain_get(f->plain, full, &err);
    if (err)
        fail_msg("no point %s", full);
    return value;
}

void servo_set(const struct servo_rig *const f, const char *const name, const double value)
{
    char full[128];
    (void)snprintf(full, sizeof full, PREFIX "%s", name);
    if (hm2_plain_set(f->plain, full, value) != 0)
        fail_msg("no point %s", full);
}

int servo_try_load(struct servo_rig *const f, const char *const config)
{
    int err = hm2_board_identify(f->board, f->link, &f->diag);
    if (err == 0)
        err = hm2_board_setup(f->board, 0, hm2_plain_binder(f->plain), config, &f->diag);
    if (err == 0)
        err = hm2_board_start(f->board, &f->diag);
    f->start_ns = link_now_ns(f->link);
    return err;
}

void servo_load(struct servo_rig *const f, const char *const config)
{
    if (servo_try_load(f, config) != 0)
        fail_msg("%s", f->diag.text);
}

void servo_cycle(struct servo_rig *const f)
{
    const int64_t begin_ns = link_now_ns(f->link);
    hm2_board_read(f->board, PERIOD_NS);
    f->read_ns = link_now_ns(f->link) - begin_ns;
    sim_net_sleep_until(f->net, link_now_ns(f->link) + f->work_ns);
    hm2_board_write(f->board, PERIOD_NS);
    f->start_ns += f->period_ns;
    sim_net_sleep_until(f->net, f->start_ns);
}

void servo_cycles(struct servo_rig *const f, const unsigned count)
{
    for (unsigned i = 0; i < count; i++)
        servo_cycle(f);
}

void servo_faults(const struct servo_rig *const f, const struct sim_faults *const faults)
{
    assert_int_equal(sim_net_set_faults(f->net, faults), 0);
}

void servo_no_faults(const struct servo_rig *const f)
{
    servo_faults(f, &(struct sim_faults){.seed = 1});
}

static void spoil(void *const context, const uint8_t *const data, const size_t len, const bool done)
{
    struct servo_rig *const f = context;
    (void)data;
    (void)len;
    if (!done || !f->spoil_reply)
        return;
    servo_faults(f, &f->reply_faults);
    f->spoil_reply = false;
}

void servo_spoil_next_reply(struct servo_rig *const f, const struct sim_faults *const how)
{
    f->reply_faults = *how;
    f->spoil_reply = true;
    sim_net_on_taken(f->net, spoil, f);
}

bool servo_message(const struct servo_rig *const f, const char *const words)
{
    char text[1024];
    bool error;
    while (hm2_board_next_message(f->board, text, sizeof text, &error) > 0)
        if (strstr(text, words))
            return true;
    return false;
}
