/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Lines from a person (with history and completion where libedit was found) or from a pipe. */
#ifndef PROMPT_H
#define PROMPT_H

#include <stdbool.h>
#include <stddef.h>

#include "session.h"

struct prompt;

/* NULL = no memory. */
struct prompt *prompt_new(struct hal_session *session);
void prompt_free(struct prompt *prompt);
/* The next line, valid until the next call; NULL at the end of input. An interrupted line comes back empty. */
const char *prompt_read(struct prompt *prompt);

/* What Tab does, for any line editor: the text to insert at the cursor, which is at the end of line, and whether names
 * should be listed because several are possible. Returns the number of names. */
size_t prompt_complete(const struct hal_session *session, const char *line, char *insert, size_t size);

#endif
