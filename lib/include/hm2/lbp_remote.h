/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Parameters and firmware of a smart-serial remote in set-up mode, for tools: over a serial line or through a port of
 * an FPGA card. What parameters there are, the remote tells (seed 003, "PROCESS DATA DISCOVERY"); no name is known
 * here. Not realtime safe. One thread at a time.
 */
#ifndef HM2_LBP_REMOTE_H
#define HM2_LBP_REMOTE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/lbp.h>
#include <hm2/sslbp.h>

/* How a remote is reached. All return 0 or a negative enum hm2_err, with a sentence where their owner puts it. */
struct lbp_access {
    void *context;
    int (*read)(void *context, uint16_t address, unsigned bytes, uint64_t *value); /* 1, 2, 4, 8 */
    int (*write)(void *context, uint16_t address, unsigned bytes, uint64_t value);
    int (*memory)(void *context, enum lbp_memory memory); /* what addresses mean from now on */
    int (*local)(void *context, enum lbp_local code, uint8_t *value);
};

/* Over a serial line; the client must outlive it. */
HM2_API struct lbp_access lbp_client_access(struct lbp_client *client);

/* Through a port in set-up mode. */
struct lbp_port_channel {
    const struct sslbp_port *port;
    unsigned channel;
};
HM2_API struct lbp_access lbp_port_access(struct lbp_port_channel *channel);
/* The same as lbp_client_identify(), from what the port has found at START. */
HM2_API int HM2_MUST_CHECK lbp_port_identify(const struct lbp_port_channel *channel, struct lbp_identity *identity);

/* ---- parameters ------------------------------------------------------------------------------------------------- */

struct lbp_remote {
    struct lbp_access access;
    const char *name; /* for messages */
    struct hm2_diag *diag;
    struct lbp_identity identity;
    /* filled by lbp_remote_discover() */
    struct sslbp_tables tables;
};

/* Read the tables. HM2_ERR_UNSUPPORTED when the remote has none. */
HM2_API int HM2_MUST_CHECK lbp_remote_discover(struct lbp_remote *remote);
/* Parameters first, process data behind them; NULL behind the last. */
HM2_API const struct sslbp_field *lbp_remote_field(const struct lbp_remote *remote, unsigned index);
/* By name in any case, or by the beginning of a single name. HM2_ERR_NOTFOUND, or HM2_ERR_INVALID for the beginning of
 * several, with the names in diag. */
HM2_API int HM2_MUST_CHECK lbp_remote_find(const struct lbp_remote *remote, const char *name,
                                           const struct sslbp_field **field);
/* Raw value, of at most 64 bits (longer fields: HM2_ERR_UNSUPPORTED). */
HM2_API int HM2_MUST_CHECK lbp_remote_get(const struct lbp_remote *remote, const struct sslbp_field *field,
                                          uint64_t *raw);
/* Write it, exactly the bytes of the field. What is non-volatile is read back: HM2_ERR_MISMATCH when it did not take.
 * HM2_ERR_STATE for fields that can only be read. */
HM2_API int HM2_MUST_CHECK lbp_remote_put(const struct lbp_remote *remote, const struct sslbp_field *field,
                                          uint64_t raw);

/* Decimal (floats as such) or hexadecimal without a prefix, as RPD and WPD take and give them (seed 003, "RPD, WPD, AND
 * UFLBP"). Parsing checks the width of the field, and the limits that the remote gives for a parameter. */
#define LBP_VALUE_TEXT 32u
HM2_API void lbp_value_text(const struct sslbp_field *field, uint64_t raw, bool hex, char text[LBP_VALUE_TEXT]);
HM2_API int HM2_MUST_CHECK lbp_remote_parse(const struct lbp_remote *remote, const struct sslbp_field *field,
                                            const char *text, bool hex, uint64_t *raw);

/* ---- firmware --------------------------------------------------------------------------------------------------- */

/* What the remote's flash is made of; it tells in powers of two. */
struct lbp_flash {
    uint32_t block_bytes, page_bytes;
};

#define LBP_IMAGE_MAX (UINT32_C(1) << 20)

/* Ask for the sizes and judge the image: HM2_ERR_MISMATCH when it has nothing to write behind block 0, which holds the
 * loader and is never written, or is longer than LBP_IMAGE_MAX; HM2_ERR_UNSUPPORTED when the remote gives no sensible
 * sizes. Nothing has been changed then. */
HM2_API int HM2_MUST_CHECK lbp_remote_check_image(const struct lbp_remote *remote, const uint8_t *image, size_t len,
                                                  struct lbp_flash *flash);
/* Called after every block. */
typedef void (*lbp_progress_fn)(void *context, uint32_t done_bytes, uint32_t all_bytes);
/*
 * Erase and write every block that is not all zeros, as LinuxCNC's setsserial does, each step confirmed by the cookie
 * and by the remote's status. No command to read flash back is known: the remote's own checks are all the verification
 * there is. A failure leaves the remote with half a firmware; its loader is untouched, so that it can be repeated.
 */
HM2_API int HM2_MUST_CHECK lbp_remote_update(const struct lbp_remote *remote, const struct lbp_flash *flash,
                                             const uint8_t *image, size_t len, lbp_progress_fn progress, void *context);

#endif
