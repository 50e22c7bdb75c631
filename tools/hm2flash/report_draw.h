/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Connectors as drawings (SVG) with a table of their pins. */
#ifndef HM2FLASH_REPORT_DRAW_H
#define HM2FLASH_REPORT_DRAW_H

#include <stdio.h>

#include <hm2/idrom.h>

#include "names.h"

struct connector {
    const struct hm2_idrom *rom;
    unsigned port;
    const char *name, *daughter;           /* daughter: name of the board behind it, or NULL */
    const struct hm2_terminals *terminals; /* or NULL */
};

void draw_connector(FILE *out, const struct connector *connector);
/* Text with nothing left in it that HTML would take for its own. */
void html_text(FILE *out, const char *text);

#endif
