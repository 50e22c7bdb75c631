/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* New firmware for a remote. The manual names the tool and not the procedure; this is LinuxCNC's (setsserial). */
#include <hm2/lbp_remote.h>

/* Addresses while they mean the flash. */
enum { AT_PAGE = 0x0000, AT_OFFSET = 0x8000, AT_BLOCK_LOG2 = 0x8004, AT_PAGE_LOG2 = 0x8005, AT_COMMIT = 0x8007 };
#define COMMIT_ERASE   0xFEu
#define COMMIT_WRITE   0xFDu
#define MIN_PAGE_LOG2  3u /* the buffer is filled eight bytes at a time */
#define MAX_BLOCK_LOG2 16u
#define WRITE_BYTES    8u
#define REFUSED        (LBP_STATUS_CRC | LBP_STATUS_OVERFLOW | LBP_STATUS_WRITE)

static int set_memory(const struct lbp_remote *const remote, const enum lbp_memory memory)
{
    return remote->access.memory(remote->access.context, memory);
}

static int get_byte(const struct lbp_remote *const remote, const uint16_t address, uint64_t *const value)
{
    return remote->access.read(remote->access.context, address, 1, value);
}

static int put(const struct lbp_remote *const remote, const uint16_t address, const unsigned bytes,
               const uint64_t value)
{
    return remote->access.write(remote->access.context, address, bytes, value);
}

static int get_sizes(const struct lbp_remote *const remote, struct lbp_flash *const flash)
{
    uint64_t block = 0, page = 0;
    int err = set_memory(remote, LBP_MEMORY_FLASH);
    if (!err)
        err = get_byte(remote, AT_BLOCK_LOG2, &block);
    if (!err)
        err = get_byte(remote, AT_PAGE_LOG2, &page);
    const int closed = set_memory(remote, LBP_MEMORY_WORKING);
    if (err || closed)
        return err ? err : closed;
    if (page < MIN_PAGE_LOG2 || page > block || block > MAX_BLOCK_LOG2)
        return hm2_diag_add(
            remote->diag, HM2_ERR_UNSUPPORTED,
            "%s: blocks of 2^%u and pages of 2^%u bytes found, at most 2^%u and at least 2^%u expected: "
            "this remote's firmware cannot be updated here.",
            remote->name, (unsigned)block, (unsigned)page, MAX_BLOCK_LOG2, MIN_PAGE_LOG2);
    flash->block_bytes = UINT32_C(1) << block;
    flash->page_bytes = UINT32_C(1) << page;
    return 0;
}

/* What lies behind the end of the image is 0. */
static uint8_t image_byte(const uint8_t *const image, const size_t len, const size_t at)
{
    return at < len ? image[at] : 0;
}

static bool is_blank(const struct lbp_flash *const flash, const uint8_t *const image, const size_t len,
                     const uint32_t at)
{
    for (uint32_t i = 0; i < flash->block_bytes; i++)
        if (image_byte(image, len, at + i) != 0)
            return false;
    return true;
}

int lbp_remote_check_image(const struct lbp_remote *const remote, const uint8_t *const image, const size_t len,
                           struct lbp_flash *const flash)
{
    *flash = (struct lbp_flash){0};
    const int err = get_sizes(remote, flash);
    if (err)
        return err;
    bool blank = true;
    for (uint32_t at = flash->block_bytes; len <= LBP_IMAGE_MAX && at < len && blank; at += flash->block_bytes)
        blank = is_blank(flash, image, len, at);
    if (len <= LBP_IMAGE_MAX && !blank)
        return 0;
    return hm2_diag_add(remote->diag, HM2_ERR_MISMATCH,
                        "%s: the image has %zu bytes%s; expected up to %u with something in them behind the first %u, "
                        "which are the loader's: this is no firmware of a remote.",
                        remote->name, len, len <= LBP_IMAGE_MAX ? " and nothing to write" : "", (unsigned)LBP_IMAGE_MAX,
                        (unsigned)flash->block_bytes);
}

/* ---- writing ------------------------------------------------------------------------------------------------------
 */

struct update {
    const struct lbp_remote *remote;
    const struct lbp_flash *flash;
    const uint8_t *image;
    size_t len;
    uint8_t cookie, status; /* as the remote gave them last */
    uint8_t status_before;  /* errors of former times do not count */
};

static int ask(struct update *const u)
{
    const struct lbp_access *const access = &u->remote->access;
    const int err = access->local(access->context, LBP_GET_COOKIE, &u->cookie);
    return err ? err : access->local(access->context, LBP_GET_STATUS, &u->status);
}

/* What confirms every step must work before the first. */
static int prove_contact(struct update *const u)
{
    const int err = ask(u);
    u->status_before = u->status;
    if (!err && u->cookie != LBP_COOKIE)
        return hm2_diag_add(u->remote->diag, HM2_ERR_IO,
                            "%s: cookie 0x%02X found, 0x%02X expected. Nothing has been changed.", u->remote->name,
                            u->cookie, LBP_COOKIE);
    return err;
}

static int commit(struct update *const u, const uint8_t how, const uint32_t offset)
{
    int err = put(u->remote, AT_COMMIT, 1, how);
    if (!err)
        err = ask(u);
    if (!err && (u->cookie != LBP_COOKIE || u->status & ~u->status_before & REFUSED))
        return hm2_diag_add(
            u->remote->diag, HM2_ERR_IO,
            "%s: %s flash at 0x%X: cookie 0x%02X and status 0x%02X found; the remote has no whole "
            "firmware now. Its loader is untouched: repeat the update before its power is switched off.",
            u->remote->name, how == COMMIT_ERASE ? "erasing" : "writing", (unsigned)offset, u->cookie, u->status);
    return err;
}

static int write_page(struct update *const u, const uint32_t offset)
{
    int err = put(u->remote, AT_OFFSET, 4, offset);
    for (uint32_t at = 0; !err && at < u->flash->page_bytes; at += WRITE_BYTES) {
        uint64_t value = 0;
        for (unsigned i = 0; i < WRITE_BYTES; i++)
            value |= (uint64_t)image_byte(u->image, u->len, offset + at + i) << 8u * i;
        err = put(u->remote, (uint16_t)(AT_PAGE + at), WRITE_BYTES, value);
    }
    return err ? err : commit(u, COMMIT_WRITE, offset);
}

static int write_block(struct update *const u, const uint32_t offset)
{
    int err = put(u->remote, AT_OFFSET, 4, offset);
    if (!err)
        err = commit(u, COMMIT_ERASE, offset);
    for (uint32_t at = 0; !err && at < u->flash->block_bytes; at += u->flash->page_bytes)
        err = write_page(u, offset + at);
    return err;
}

int lbp_remote_update(const struct lbp_remote *const remote, const struct lbp_flash *const flash,
                      const uint8_t *const image, const size_t len, const lbp_progress_fn progress, void *const context)
{
    struct update u = {.remote = remote, .flash = flash, .image = image, .len = len};
    if (len > LBP_IMAGE_MAX || flash->block_bytes == 0)
        return HM2_ERR_RANGE;
    int err = prove_contact(&u);
    if (err)
        return err;
    err = set_memory(remote, LBP_MEMORY_FLASH);
    for (uint32_t at = flash->block_bytes; !err && at < len; at += flash->block_bytes) {
        if (!is_blank(flash, image, len, at))
            err = write_block(&u, at);
        if (!err && progress)
            progress(context, at + flash->block_bytes < len ? at + flash->block_bytes : (uint32_t)len, (uint32_t)len);
    }
    const int closed = set_memory(remote, LBP_MEMORY_WORKING);
    return err ? err : closed;
}
