/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <hm2/err.h>

#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include <hm2/bytes.h>

static const char *const names[] = {
    [0] = "success",
    [-HM2_ERR_INVALID] = "invalid argument",
    [-HM2_ERR_RANGE] = "out of range",
    [-HM2_ERR_NOSPACE] = "does not fit",
    [-HM2_ERR_NOMEM] = "out of memory",
    [-HM2_ERR_TIMEOUT] = "no answer in time",
    [-HM2_ERR_IO] = "input/output error",
    [-HM2_ERR_MALFORMED] = "malformed data",
    [-HM2_ERR_UNSUPPORTED] = "not supported",
    [-HM2_ERR_MISMATCH] = "not what was expected",
    [-HM2_ERR_NOTFOUND] = "not found",
    [-HM2_ERR_STATE] = "not possible now",
    [-HM2_ERR_HOST] = "refused by the host",
};

const char *hm2_strerror(const int err)
{
    const int count = (int)(sizeof names / sizeof names[0]);
    return err <= 0 && err > -count ? names[-err] : "unknown error";
}

void hm2_diag_clear(struct hm2_diag *const diag)
{
    diag->text[0] = '\0';
    diag->len = 0;
    diag->problems = diag->warnings = diag->dropped = 0;
}

/* Room that stays free for the mark of a text that was cut. */
#define CUT_MARK "...\n"

static void append(struct hm2_diag *const diag, const char *const prefix, const char *const format, va_list args)
{
    const size_t room = HM2_DIAG_SIZE - sizeof CUT_MARK;
    char sentence[1024];
    const int len = vsnprintf(sentence, sizeof sentence, format, args);
    size_t used = len < 0 ? 0 : (size_t)len;
    if (used >= sizeof sentence)
        used = sizeof sentence - 1;
    while (used > 0 && sentence[used - 1] == '\n')
        used--;
    if (diag->dropped || diag->len + strlen(prefix) + used + 1 > room) {
        if (diag->dropped++ == 0) {
            memcpy(diag->text + diag->len, CUT_MARK, sizeof CUT_MARK);
            diag->len += sizeof CUT_MARK - 1;
        }
        return;
    }
    diag->len +=
        (size_t)snprintf(diag->text + diag->len, HM2_DIAG_SIZE - diag->len, "%s%.*s\n", prefix, (int)used, sentence);
}

int hm2_diag_add(struct hm2_diag *const diag, const int err, const char *const format, ...)
{
    if (diag) {
        va_list args;
        va_start(args, format);
        append(diag, "", format, args);
        va_end(args);
        diag->problems++;
    }
    return err;
}

void hm2_diag_warn(struct hm2_diag *const diag, const char *const format, ...)
{
    if (diag) {
        va_list args;
        va_start(args, format);
        append(diag, "warning: ", format, args);
        va_end(args);
        diag->warnings++;
    }
}
