/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Error codes and diagnostics shared by every part of the library.
 *
 * Functions return 0 (or a count) on success and a negative enum hm2_err on failure. A caller that wants to tell a
 * person what went wrong passes a struct hm2_diag; it collects whole sentences: what was expected, what was found,
 * where, and what to do next. All functions here are thread safe as long as two threads do not share one diag.
 * hm2_diag_add() formats text and therefore must not be called from a realtime thread; hm2_strerror() may be.
 */
#ifndef HM2_ERR_H
#define HM2_ERR_H

#include <stddef.h>

#define HM2_API        __attribute__((visibility("default")))
#define HM2_MUST_CHECK __attribute__((warn_unused_result))
/* A function of the cycle that is seldom called: it must not cost its callers registers to save and code to pass over.
 */
#define HM2_RARE __attribute__((noinline, cold))

enum hm2_err {
    HM2_OK = 0,
    HM2_ERR_INVALID = -1,     /* an argument, option or configuration string is wrong */
    HM2_ERR_RANGE = -2,       /* a number is outside its documented limits */
    HM2_ERR_NOSPACE = -3,     /* a fixed-size buffer, packet or table is full */
    HM2_ERR_NOMEM = -4,       /* the host gave no memory */
    HM2_ERR_TIMEOUT = -5,     /* the deadline passed without an answer */
    HM2_ERR_IO = -6,          /* the operating system or the link refused to move bytes */
    HM2_ERR_MALFORMED = -7,   /* bytes from a wire or a file do not follow their format */
    HM2_ERR_UNSUPPORTED = -8, /* well formed, but nothing here can handle it */
    HM2_ERR_MISMATCH = -9,    /* well formed, but not what was expected (wrong card, wrong firmware) */
    HM2_ERR_NOTFOUND = -10,   /* no such name, card, module or pin */
    HM2_ERR_STATE = -11,      /* not possible in the present state */
    HM2_ERR_HOST = -12,       /* the HAL host refused (name too long, duplicate name, not ready) */
};

/* Short constant English name of an error ("timeout"); never NULL, also for unknown values. */
HM2_API const char *hm2_strerror(int err);

#define HM2_DIAG_SIZE 4096u

/* Collected sentences, each ended by a newline. Zero-initialise, or call hm2_diag_clear(). */
struct hm2_diag {
    char text[HM2_DIAG_SIZE]; /* always NUL terminated */
    size_t len;
    unsigned problems; /* sentences added with hm2_diag_add(), also those that no longer fitted */
    unsigned warnings; /* sentences added with hm2_diag_warn() */
    unsigned dropped;  /* sentences that did not fit; the text then ends in "...\n" */
};

HM2_API void hm2_diag_clear(struct hm2_diag *diag);

/* Append one sentence; a final newline is added when missing. diag may be NULL. Returns err, so that a caller can
 * write: return hm2_diag_add(diag, HM2_ERR_RANGE, "..."). Warnings are prefixed "warning: ". */
HM2_API int hm2_diag_add(struct hm2_diag *diag, int err, const char *format, ...) __attribute__((format(printf, 3, 4)));
HM2_API void hm2_diag_warn(struct hm2_diag *diag, const char *format, ...) __attribute__((format(printf, 2, 3)));

#endif
