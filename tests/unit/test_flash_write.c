/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The flash programmer on simulated cards, in virtual time: what it writes, what it leaves alone, what it survives. */
#include "unit.h"

#include <hm2/flash.h>
#include <hm2/sim.h>

#include "flash_images.h"

#define HALF            0x100000u
#define SECTOR          65536u
#define FALLBACK_XILINX 0x10000u

struct fixture {
    struct sim_card *sim;
    struct sim_net *net;
    struct flash_card *card;
    struct flash_job *job;
    struct flash_options options;
    struct hm2_diag diag;
    uint8_t *flash;
    size_t flash_bytes;
    uint8_t *file, *other;
    size_t len, other_len;
    struct flash_image image;
};

/* A card as it is delivered: boot block, a fallback image, and no user image. */
static void deliver(struct fixture *const f, const bool xilinx)
{
    struct flash_image fallback;
    f->flash = sim_card_flash(f->sim, &f->flash_bytes);
    if (xilinx)
        f->other_len = make_xilinx(&(struct xilinx_file){.seed = 99}, f->other);
    else
        f->other_len = make_efinix(&(struct efinix_file){.seed = 99, .fallback = true}, f->other);
    assert_int_equal(flash_image_parse(f->other, f->other_len, &fallback, &f->diag), 0);
    memcpy(f->flash + (xilinx ? FALLBACK_XILINX : 0), fallback.payload, fallback.payload_bytes);
    if (xilinx)
        flash_boot_block(flash_chip_of_id(0x14), f->flash);
}

static struct fixture *fixture_new(const char *const profile)
{
    struct fixture *const f = calloc(1, sizeof *f);
    assert_non_null(f);
    f->file = malloc(FLASH_IMAGE_MOST);
    f->other = malloc(FLASH_IMAGE_MOST);
    assert_non_null(f->file);
    assert_non_null(f->other);
    const struct sim_card_options options = {.profile = profile, .seed = 1};
    if (sim_card_new(&f->sim, &options, &f->diag) != 0)
        fail_msg("%s", f->diag.text);
    assert_int_equal(sim_net_new(&f->net, f->sim, NULL), 0);
    if (flash_card_new(&f->card, sim_net_link(f->net), &f->diag) != 0)
        fail_msg("%s", f->diag.text);
    const bool xilinx = strcmp(profile, "7i96s") != 0;
    deliver(f, xilinx);
    if (xilinx)
        f->len = make_xilinx(&(struct xilinx_file){.seed = 1}, f->file);
    else
        f->len = make_efinix(&(struct efinix_file){.seed = 1}, f->file);
    f->options.file_name = xilinx ? "7i93_test.bit" : "7i96s_test.bin";
    if (flash_image_parse(f->file, f->len, &f->image, &f->diag) != 0)
        fail_msg("%s", f->diag.text);
    return f;
}

static int set_up_7i93(void **state)
{
    *state = fixture_new("7i93");
    return 0;
}

static int set_up_7i96s(void **state)
{
    *state = fixture_new("7i96s");
    return 0;
}

static int tear_down(void **state)
{
    struct fixture *const f = *state;
    flash_job_free(f->job);
    flash_card_free(f->card);
    sim_net_free(f->net);
    sim_card_free(f->sim);
    free(f->file);
    free(f->other);
    free(f);
    return 0;
}

static void write_image(struct fixture *const f)
{
    flash_job_free(f->job);
    f->job = NULL;
    int err = flash_job_write(&f->job, f->card, &f->image, &f->options, &f->diag);
    if (err == 0)
        err = flash_job_run(f->job, NULL, NULL, &f->diag);
    if (err != 0)
        fail_msg("%d: %s", err, f->diag.text);
}

static void assert_flash_holds_image(const struct fixture *const f)
{
    for (size_t i = 0; i < f->image.payload_bytes; i++)
        if (f->flash[HALF + i] != f->image.payload[i])
            fail_msg("0x%06zX: expected 0x%02X but found 0x%02X", HALF + i, f->image.payload[i], f->flash[HALF + i]);
}

/* Answers that mesaflash waits for to do the same (flash tool reference 4.2). */
static uint64_t mesaflash_waits(const struct fixture *const f)
{
    const uint64_t pages = (f->image.payload_bytes + 255) / 256,
                   sectors = (f->image.payload_bytes + SECTOR - 1) / SECTOR;
    const uint64_t boot = f->image.family == FLASH_XILINX;
    return 3 + 2 * boot + sectors + 2 * pages;
}

static void writes_an_image_and_its_filler(void **state)
{
    struct fixture *const f = *state;
    const struct flash_counters before = flash_card_counters(f->card);
    write_image(f);
    const struct flash_counters after = flash_card_counters(f->card);
    assert_flash_holds_image(f);
    const size_t end = (f->image.payload_bytes + 255) / 256 * 256;
    for (size_t i = f->image.payload_bytes; i < end; i++)
        assert_int_equal(f->flash[HALF + i], f->image.payload[i - 8192]);
    assert_int_equal(after.erases, 0); /* a blank area needs none */
    assert_true(5 * (after.sent - before.sent) <= mesaflash_waits(f));
}

static void replaces_an_image(void **state)
{
    struct fixture *const f = *state;
    memset(f->flash + HALF, 0, 11 * SECTOR);
    const struct flash_counters before = flash_card_counters(f->card);
    write_image(f);
    const struct flash_counters after = flash_card_counters(f->card);
    assert_flash_holds_image(f);
    assert_int_equal(after.erases, (f->image.payload_bytes + SECTOR - 1) / SECTOR);
    assert_true(5 * (after.sent - before.sent) <= mesaflash_waits(f));
}

static void leaves_a_right_image_alone(void **state)
{
    struct fixture *const f = *state;
    write_image(f);
    const struct flash_counters before = flash_card_counters(f->card);
    write_image(f);
    const struct flash_counters after = flash_card_counters(f->card);
    assert_int_equal(after.erases, before.erases);
    assert_int_equal(after.pages, before.pages);
    assert_int_equal(flash_job_plan(f->job)->to_write, 0);
}

int main(void)
{
#define BOTH(test)                                            \
    {#test " (7I93)", test, set_up_7i93, tear_down, NULL},    \
    {                                                         \
#test " (7I96S)", test, set_up_7i96s, tear_down, NULL \
    }
    const struct CMUnitTest tests[] = {
        BOTH(writes_an_image_and_its_filler),
        BOTH(replaces_an_image),
        BOTH(leaves_a_right_image_alone),
    };
    return cmocka_run_group_tests_name("flash write", tests, NULL, NULL);
}
